"""A Stimulus: inputs of one character, and what share of a verdict's steps they get."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program, Value
from firmloop.verify.reference import Raw
from firmloop.verify.scaling import to_raw

Array = NDArray[np.float64]

LANE_STEPS = 1000


@dataclass(frozen=True, slots=True)
class Stimulus:
    """Inputs (lanes, steps, m) of one character: `make(program, random, lanes, steps)`.

    `weight` is its share of the steps, of the sum of all weights; `steps` is the length of a lane. `order` is its place
    among the others: all draw from one stream of random numbers, so that a later one leaves those before it unchanged.
    `short_lanes`: a few steps show its character, for golden vectors. `single_steps`: even one does. `adversarial`: it
    brings values and roundings to their ends; `longest` is how long its lanes may then grow, 0 for not at all.
    """

    name: str
    order: int
    weight: int
    make: Callable[[Program, np.random.Generator, int, int], Raw]
    steps: int = LANE_STEPS
    short_lanes: bool = True
    single_steps: bool = False
    adversarial: bool = False
    longest: int = 0


def stack(program: Program, columns: Sequence[Array]) -> Raw:
    """Round physical columns (lanes, steps), one an input, into raw inputs (lanes, steps, m)."""
    return np.stack([to_raw(v, c) for v, c in zip(program.inputs, columns, strict=True)], axis=-1)


def range_of(value: Value) -> tuple[float, float]:
    """Return the range of an input in its unit."""
    scale = 2.0**-value.number.fraction
    return value.low * scale, value.high * scale


def resolution(value: Value) -> float:
    """Return the smallest step of an input in its unit; of a float, that of its largest value."""
    low, high = range_of(value)
    return 2.0**-value.number.fraction if value.number.kind == "fixed" else max(abs(low), abs(high)) * 2.0**-22
