"""Solve damped normal equations for a step that stays inside its bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def solved(normal: Array, pulled: Array, damping: float) -> Array:
    """Return the damped step; what no slope tells stays."""
    sizes = np.sqrt(np.maximum(np.diag(normal), 0.0))
    live = sizes > 1e-9
    step = np.zeros(len(pulled))
    scaled = normal[np.ix_(live, live)] / np.outer(sizes[live], sizes[live])
    scaled = scaled + (damping + 1e-12) * np.eye(int(live.sum()))
    step[live] = np.linalg.lstsq(scaled, pulled[live] / sizes[live], rcond=1e-13)[0] / sizes[live]
    return step


def solved_within(normal: Array, pulled: Array, damping: float, down: Array, up: Array) -> Array:
    """Return the damped step whose first coordinates (k,) go down by `down`, at most 0, and up by `up` at the most.

    One by one, what comes to its bound first is held there, and the step of all others is the best beside it: merely
    cut off, it would leave a valley along which several coordinates go together.
    """
    step, held = solved(normal, pulled, damping), np.zeros(len(pulled), dtype=bool)
    count, fixed = len(down), np.zeros(len(pulled))
    while True:
        room = np.where(step[:count] < 0.0, down, up)
        out = np.flatnonzero((np.abs(step[:count]) > np.abs(room)) & ~held[:count])
        if not len(out):
            return step
        first = out[np.argmin(np.abs(room[out] / step[out]))]
        held[first], fixed[first] = True, room[first]
        free, step = ~held, fixed.copy()
        left = pulled[free] - normal[np.ix_(free, held)] @ fixed[held]
        step[free] = solved(normal[np.ix_(free, free)], left, damping)
