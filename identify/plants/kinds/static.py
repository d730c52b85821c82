"""An actuator without memory worth naming: its output is gain * input + offset.

A row is read before its own input acts. What the input was before the first row is in no recording: it is simulated as
what it is in the first row, and a fit leaves that row out. Step by step, in a closed loop or as an FMU, it was zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.signal import Signal


def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
    """Write the equation; there is no state."""
    state, command, constants = ca.SX.sym("x", 0), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
    gain, offset = ca.vertsplit(constants)
    return Plant(
        kind=KIND.name,
        states=(),
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        rate=equations("rate", state, command, constants, ca.SX(0, 1)),
        reading=equations("reading", state, command, constants, gain * command + offset),
        delay=None,
    )


def shapes(step: float, span: float) -> tuple[Mapping[str, float], ...]:
    """Propose no offset; what the data shows is linear in both."""
    return ({"offset": 0.0},)


KIND = PlantKind(
    name="static",
    constants=(
        PlantConstant("gain", "", -math.inf, math.inf, open_low=False, guessable=True),
        PlantConstant("offset", "", -math.inf, math.inf, open_low=False, guessable=True),
    ),
    inputs=(),
    outputs=(),
    build=build,
    shapes=shapes,
    scale="gain",
    level="offset",
)
