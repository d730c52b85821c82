"""Second-order lag with delay: x'' + 2 zeta wn x' + wn^2 x = gain wn^2 (u(t - delay) - input_at_rest).

The output is output_at_rest + x.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations, may_be, moving_balance
from firmloop.identify.plants.operating_point import (
    OUTPUT,
    deviating,
    driven,
    rest_constants,
    rest_input,
    rest_levels,
    shown,
)
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.signal import Signal


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equations as two states, the output and its slope; `gain` is in output units per input unit.

    A position that lags is a torque balance, x'' / wn^2 = gain u - x - 2 zeta x' / wn - (friction, springs, load), all
    in output units.
    """
    state, command, constants = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    gain, frequency, damping = ca.vertsplit(constants)[:3]
    levels = rest_levels(parameters, constants)
    drives = gain * driven(command, levels)
    place, slope = ca.vertsplit(state)
    bend = frequency**2 * (drives - place) - 2.0 * damping * frequency * slope
    (output,) = outputs
    per = ca.Function("per", [constants], [frequency**2])
    effort = equations("effort", state, command, constants, drives)
    unit = f"{output.unit}/s" if output.unit else ""
    return Plant(
        kind=KIND.name,
        states=(deviating(output, levels), Signal(f"{output.name}_slope", unit, -math.inf, math.inf)),
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", state, command, constants, ca.vertcat(slope, bend)),
        reading=equations("reading", state, command, constants, shown(place, levels)),
        delay="delay_s",
        input_at_rest=rest_input(levels),
        balances=(moving_balance(output, 1, 0, per, effort),) if may_be(output, "position") else (),
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose natural frequencies from once in the recording to the sampling limit, three dampings and delays."""
    slowest, fastest = 2.0 / span, math.pi / step
    frequencies = [slowest * (fastest / slowest) ** (k / 13) for k in range(14)]
    delays = [0.0, 4.0 * step, 32.0 * step]
    return tuple(
        {"natural_frequency_rad_s": frequency, "damping_ratio": damping, "delay_s": delay}
        for frequency, damping, delay in itertools.product(frequencies, (0.05, 0.4, 2.0), delays)
    )


KIND = PlantKind(
    name="second_order",
    constants=(
        PlantConstant("gain", "", -math.inf, math.inf, open_low=False, guessable=True),
        PlantConstant("natural_frequency_rad_s", "rad/s", 0.0, math.inf, open_low=True, guessable=True),
        PlantConstant("damping_ratio", "", 0.0, math.inf, open_low=False, guessable=True),
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
