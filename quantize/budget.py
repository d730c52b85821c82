"""Choose how much work one search of a law's quadratic program may take, from its whole declared region.

SPARE times the work of the worst of the searches drawn is the budget; a search that would take more is cut short, with
its status. So the work of every step is bounded, and the bound is near to what is needed.
"""

from __future__ import annotations

import numpy as np

from design.active_set import SOLVED, exact, solve
from design.law import Law, Quadratic
from design.region import drawn_parameters
from quantize.quadratic import rows_of, table_of

DRAWN = 700
SPARE = 1.4
NEAR = 5e-4  # share of a move's range by which the two arithmetics may differ
LEAST = 100  # work, for a problem that hardly ever meets a limit
LONGEST = 15_000  # work: a search beyond it is taken for one that does not end


def budget_of(law: Law, problem: Quadratic, arithmetic: str) -> tuple[int, bool]:
    """Return the work that one search may take, and whether its answers need a check in this arithmetic.

    They do where one of the drawn searches ends with moves that are not those of float64.
    """
    parameters = drawn_parameters(law, DRAWN, 0)
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
