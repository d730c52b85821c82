"""How far the figures of a loop may be off because the plant's parameters are known to their intervals only."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from firmloop.identify.error import IdentifyError
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import Linear, linearize

_MOST = 12  # parameters: each costs the figures once more

Figures = Callable[[Linear], Mapping[str, float]]


def half_widths(plant: Plant, figures: Figures) -> Mapping[str, float]:
    """Return half widths of 95 % intervals of `figures`, by name; none where no parameter has an interval.

    Each parameter is moved to the upper end of its interval (the lower one where that is beyond its bound), and the
    changes are added as squares: parameters count as independent, because a project holds no correlations. Infinite
    where a figure that is finite is not so there, or where the loop cannot be closed.
    """
    unsure = [k for k, parameter in enumerate(plant.parameters) if parameter.deviation]
    if not unsure or len(unsure) > _MOST:
        return {}
    middle = figures(linearize(plant))
    squares = dict.fromkeys(middle, 0.0)
    for k in unsure:
        end = _figures(_moved(plant, k), figures)
        for name, value in middle.items():
            squares[name] += _apart(end.get(name, math.inf), value) ** 2
    return {name: math.sqrt(square) for name, square in squares.items() if math.isfinite(middle[name])}


def figures_of(*nouns: object) -> Mapping[str, float]:
    """Return the figures of nouns by the names of their fields; a verdict is none."""
    named = {name: getattr(noun, name) for noun in nouns for name in getattr(type(noun), "__slots__", ())}
    return {name: value for name, value in named.items() if not isinstance(value, bool)}


def _moved(plant: Plant, index: int) -> Plant:
    parameter, known = plant.parameters[index], plant.parameters
    reach = NORMAL_95 * (parameter.deviation or 0.0)
    value = parameter.value + reach
    if value > parameter.high:
        value = max(parameter.value - reach, 0.5 * (parameter.low + parameter.value))
    return replace(plant, parameters=(*known[:index], replace(parameter, value=value), *known[index + 1 :]))


def _figures(plant: Plant, figures: Figures) -> Mapping[str, float]:
    try:
        return figures(linearize(plant))
    except IdentifyError:
        return {}


def _apart(one: float, other: float) -> float:
    return abs(one - other) if math.isfinite(one) else math.inf
