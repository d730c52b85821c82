"""Choose how much work one search of a law's quadratic program may take, from its whole declared region.

The law's inputs and states are drawn over their ranges: at the corners, evenly, and toward the middle. SPARE times the
work of the worst of these searches is the budget; a search that would take more is cut short, with its status. So the
work of every step is bounded, and the bound is near to what is needed.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from design.active_set import SOLVED, exact, solve
from design.law import Law, Quadratic
from quantize.quadratic import rows_of, table_of

Array = NDArray[np.float64]

DRAWN = 700
CORNERS = 9  # of so many inputs and states all corners are drawn
SPARE = 1.4
NEAR = 5e-4  # share of a move's range by which the two arithmetics may differ
LEAST = 100  # work, for a problem that hardly ever meets a limit
LONGEST = 15_000  # work: a search beyond it is taken for one that does not end


def budget_of(law: Law, problem: Quadratic, arithmetic: str) -> tuple[int, bool]:
    """Return the work that one search may take, and whether its answers need a check in this arithmetic.

    They do where one of the drawn searches ends with moves that are not those of float64.
    """
    assert law.solve is not None
    signals = (*law.state, *law.inputs)
    low, high = (np.array([getattr(signal, end) for signal in signals]) for end in ("low", "high"))
    points = low + (high - low) * _shares(len(signals))
    split = len(law.state)
    parameters = np.array(law.solve.function.map(len(points))(points[:, :split].T, points[:, split:].T)).T
    table = table_of(problem, arithmetic, "drawn", LONGEST, False)
    rounded = parameters.astype(arithmetic)
    found, best = (
        solve(rows_of(table, np.dtype(arithmetic)), rounded),
        solve(exact(problem), rounded.astype(np.float64)),
    )
    low, high = (ends[: len(problem.scale)] * problem.scale for ends in (problem.low, problem.high))
    away = np.abs(np.clip(found.moves, low, high) - np.clip(best.moves, low, high)).max(axis=1)
    wrong = (found.status == SOLVED) & ((best.status != SOLVED) | (away > NEAR * float(np.max(high - low))))
    return min(LONGEST, max(LEAST, int(np.ceil(SPARE * found.work.max())))), bool(np.any(wrong))


def _shares(width: int) -> Array:
    """Return points of the unit cube (points, width)."""
    random = np.random.default_rng(0)
    even = random.uniform(size=(DRAWN, width))
    middle = 0.5 + (random.uniform(size=(DRAWN, width)) - 0.5) * random.uniform(size=(DRAWN, 1))
    corners = (
        np.array(list(itertools.product((0.0, 1.0), repeat=width)))
        if width <= CORNERS
        else random.integers(0, 2, size=(2**CORNERS, width)).astype(np.float64)
    )
    return np.concatenate([even, middle, corners])
