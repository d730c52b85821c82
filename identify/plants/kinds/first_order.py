"""First-order lag with delay: T dx/dt = gain (u(t - delay) - input_at_rest) - x, the output is output_at_rest + x."""

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
    """Write the equations; `gain` is in output units per input unit.

    A speed that lags is a torque balance, T dx/dt = gain u - x - (friction, drag, load), all in output units.
    """
    state, command, constants = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    gain, lag = ca.vertsplit(constants)[:2]
    levels = rest_levels(parameters, constants)
    drives = gain * driven(command, levels)
    per = ca.Function("per", [constants], [1.0 / lag])
    effort = equations("effort", state, command, constants, drives)
    return Plant(
        kind=KIND.name,
        states=(deviating(outputs[0], levels),),
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", state, command, constants, (drives - state) / lag),
        reading=equations("reading", state, command, constants, shown(state, levels)),
        delay="delay_s",
        input_at_rest=rest_input(levels),
        balances=(moving_balance(outputs[0], 0, -1, per, effort),) if may_be(outputs[0], "speed") else (),
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose time constants from a fraction of a sample to the whole recording, delays up to 64 samples."""
    lags = [0.5 * step * (span / step) ** (k / 11) for k in range(12)]
    delays = [0.0, *(step * 2.0**k for k in range(7))]
    return tuple({"time_constant_s": lag, "delay_s": delay} for lag, delay in itertools.product(lags, delays))


KIND = PlantKind(
    name="first_order",
    constants=(
        PlantConstant("gain", "", -math.inf, math.inf, open_low=False, guessable=True),
        PlantConstant("time_constant_s", "s", 0.0, math.inf, open_low=True, guessable=True),
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
