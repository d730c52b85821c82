"""Process model with two lags, a zero and a delay: gain (Tz s + 1) exp(-delay s) / ((T1 s + 1)(T2 s + 1)).

T2 = 0, given and not free, leaves one lag; Tz = 0 leaves no zero; Tz < 0 makes a plant that first goes the wrong way.
With both lags free the fit may exchange them: T1 is the longer one where the start says so. The input counts from
input_at_rest, the output from output_at_rest.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.operating_point import OUTPUT, driven, rest_constants, rest_input, rest_levels, shown
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.signal import Signal


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the lags one behind the other, in the output's unit: T1 x1' = K u - x1, T2 x2' = x1 - x2.

    The output is then x2 + Tz x2' = (Tz/T2) x1 + (1 - Tz/T2) x2, and with one lag x1 + Tz x1'.
    """
    values = {parameter.name: parameter for parameter in parameters}
    second = values["second_time_constant_s"]
    if second.value == 0.0 and second.free:
        raise IdentifyError(
            "plant.parameters.second_time_constant_s.value is 0 and free; give a positive start, or free = false for "
            "a single lag"
        )
    order = 1 if second.value == 0.0 else 2
    (output,) = outputs
    state, command, constants = ca.SX.sym("x", order), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    gain, lag, lag2, lead = ca.vertsplit(constants)[:4]
    levels = rest_levels(parameters, constants)
    first = ca.vertsplit(state)[0]
    rates = [(gain * driven(command, levels) - first) / lag]
    if order == 1:
        reading = first + lead * rates[0]
    else:
        last = ca.vertsplit(state)[1]
        rates.append((first - last) / lag2)
        reading = last + lead * rates[1]
    names = [f"{output.name}_first_lag", f"{output.name}_second_lag"][:order]
    return Plant(
        kind=KIND.name,
        states=tuple(Signal(name, output.unit, -math.inf, math.inf) for name in names),
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", state, command, constants, ca.vertcat(*rates)),
        reading=equations("reading", state, command, constants, shown(reading, levels)),
        delay="delay_s",
        input_at_rest=rest_input(levels),
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose lags over the recording, the second one shorter, zeros on both sides and a few delays."""
    lags = [2.0 * step * (span / step / 4.0) ** (k / 6) for k in range(7)]
    delays = [0.0, 4.0 * step, 32.0 * step]
    return tuple(
        {
            "time_constant_s": lag,
            "second_time_constant_s": share * lag,
            "zero_time_constant_s": lead * lag,
            "delay_s": delay,
        }
        for lag, share, lead, delay in itertools.product(lags, (0.2, 0.7), (0.0, 0.5, 1.5, -0.5), delays)
    )


KIND = PlantKind(
    name="process",
    constants=(
        PlantConstant("gain", "", -math.inf, math.inf, open_low=False, guessable=True),
        PlantConstant("time_constant_s", "s", 0.0, math.inf, open_low=True, guessable=True),
        PlantConstant("second_time_constant_s", "s", 0.0, math.inf, open_low=False, guessable=True),
        PlantConstant("zero_time_constant_s", "s", -math.inf, math.inf, open_low=False, guessable=True),
        PlantConstant("delay_s", "s", 0.0, math.inf, open_low=False, guessable=True),
    ),
    inputs=(),
    outputs=(),
    build=build,
    shapes=shapes,
    scale="gain",
    optional=rest_constants,
    level=OUTPUT,
)
