"""What each parameter of a controller shall be, step by step; such requests travel behind the inputs of their step.

A request within the declared range is taken before the step, any other is refused and the parameter stays what it was,
as the generated setters do. A controller without parameters has requests of no columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program, Value
from firmloop.verify.packing import untouched
from firmloop.verify.reference import Raw, element_type, start_parameters


def requests(program: Program, random: np.random.Generator, lanes: int, steps: int) -> Raw:
    """Return requests (lanes, steps, k) of every character, lane by lane.

    A third of the lanes keeps what init() sets, a third keeps one corner or one value drawn from the range, the others
    change in mid-run, together or apart: to corners, drawn values, and what the setter must refuse.
    """
    found = untouched(program, lanes, steps)
    starts = start_parameters(program)
    for j, value in enumerate(program.parameters):
        kinds = np.arange(lanes) % 3
        new = random.random((lanes, steps)) < random.choice([3e-3, 3e-2, 1.0], size=(lanes, 1))
        new[kinds != 2] = False
        new[:, 0] = kinds != 0
        picks = _drawn(value, random, (lanes, steps), np.full((lanes, steps), starts[j]))
        allowed = (picks >= value.low) & (picks <= value.high)
        picks[:, 0] = np.where(allowed[:, 0], picks[:, 0], starts[j])
        last = np.maximum.accumulate(np.where(new, np.arange(steps), 0), axis=1)
        column = np.take_along_axis(picks, last, axis=1)
        found[kinds != 0, :, j] = column[kinds != 0]
    return found


def _drawn(value: Value, random: np.random.Generator, shape: tuple[int, int], start: Raw) -> Raw:
    """Draw corners of the range, values within it, and a few that are refused."""
    kind = element_type(value.number)
    within = random.uniform(value.low, value.high, size=shape)
    choice = random.random(shape)
    fixed = value.number.kind == "fixed"
    limits = np.iinfo(kind) if fixed else np.finfo(kind)
    outside = [limits.min, limits.max, value.low - 1, value.high + 1, *([] if fixed else [np.nan, np.inf])]
    beyond = random.choice(np.clip(outside, limits.min, limits.max) if fixed else np.array(outside), size=shape)
    with np.errstate(over="ignore"):
        picks: NDArray[Any] = np.select(
            [choice < 0.25, choice < 0.5, choice < 0.6, choice < 0.7],
            [np.full(shape, value.low), np.full(shape, value.high), start.astype(np.float64), beyond],
            np.floor(within + 0.5) if fixed else within,
        )
        return picks.astype(kind)
