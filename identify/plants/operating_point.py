"""Let a lag rest elsewhere than at zero: with its input at `input_at_rest`, its output is `output_at_rest`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant
from firmloop.identify.plants.plant import Parameter
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

OUTPUT, INPUT = "output_at_rest", "input_at_rest"


def rest_constants(inputs: Sequence[str], outputs: Sequence[str]) -> tuple[PlantConstant, ...]:
    """Return the two levels, each in the unit of its signal; a level that is not given is zero."""
    levels = ((OUTPUT, unit_of(outputs[0])), (INPUT, unit_of(inputs[0])))
    return tuple(
        PlantConstant(name, unit, -math.inf, math.inf, open_low=False, guessable=False) for name, unit in levels
    )


def rest_levels(parameters: Sequence[Parameter], constants: ca.SX) -> Mapping[str, ca.SX]:
    """Return the levels that the parameters hold, by name, out of the symbols of all `constants`."""
    held = dict(zip((parameter.name for parameter in parameters), ca.vertsplit(constants), strict=True))
    return {name: held[name] for name in (OUTPUT, INPUT) if name in held}


def deviating(signal: Signal, levels: Mapping[str, ca.SX]) -> Signal:
    """Return the state that an output is read from: where the output has a level of rest, its distance from there."""
    return Signal(f"{signal.name}_deviation", signal.unit, -math.inf, math.inf) if OUTPUT in levels else signal


def driven(command: ca.SX, levels: Mapping[str, ca.SX]) -> ca.SX:
    """Return what moves the plant out of its rest."""
    return command - levels[INPUT] if INPUT in levels else command


def shown(reading: ca.SX, levels: Mapping[str, ca.SX]) -> ca.SX:
    """Return the output as it is read."""
    return reading + levels[OUTPUT] if OUTPUT in levels else reading


def rest_input(levels: Mapping[str, ca.SX]) -> str | None:
    """Return the parameter that says what the input is before a recording begins, None where it is zero."""
    return INPUT if INPUT in levels else None
