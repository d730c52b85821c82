"""Choose how much work one search of a law's quadratic program may take, from its whole declared region.

SPARE times the work of the worst of the searches drawn that end where they should is the budget; a search that would
take more is cut short, with its status: a rounded search can go round in circles, and no budget would end that. So the
work of every step is bounded, and the bound is near to what is needed.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Law, Quadratic
from firmloop.design.optimum import Solution
from firmloop.design.outcome import CAPPED, SOLVED
from firmloop.design.quadratic.region import drawn_parameters
from firmloop.quantize.formats.quadratic import rows_of, table_of
from firmloop.quantize.twins.qp import Raw, Rows, optimum, solve

DRAWN, LEAST_DRAWN = 2000, 300
SPARE = 1.4
NEAR = 5e-4  # share of a move's range by which the two arithmetics may differ
LEAST = 100  # work, for a problem that hardly ever meets a limit
LONGEST = 50_000  # work of a budget at most
ENDLESS = 3  # times the work of the longest search in float64: a search beyond it is taken for one that does not end
CHECKS = 6  # times that, where answers are checked
AT_ONCE = 64  # searches between two looks whether the others are needed
ALTOGETHER = 10_000_000  # work of all drawn searches: a sound servo takes a third; where most go round, fewer do
NUMBERS = 2**26  # drawn parameters times rows times rows, at most: fewer are drawn for a large problem


def budget_of(law: Law, problem: Quadratic, arithmetic: str) -> tuple[int, bool]:
    """Return the work that one search may take, and whether its answers need a check in this arithmetic.

    They do where one of the drawn searches finds moves where float64 finds none, others, or none where it does; the
    work of one that is checked is that of the search and of what the checks add.
    """
    drawn = max(LEAST_DRAWN, min(DRAWN, NUMBERS // len(problem.low) ** 2))
    rounded = drawn_parameters(law, drawn, 0).astype(arithmetic)
    best = optimum(problem, rounded.astype(np.float64))
    known = best.status != CAPPED  # even float64 goes round in circles, from states where no moves keep every limit
    most = int(best.work[known].max(initial=0))
    work = 0
    for one, found, right in _searches(problem, arithmetic, ENDLESS * most, False, rounded, best):
        lost = (one.status != CAPPED) & ~right
        if np.any(lost & ((one.status == SOLVED) | (found.status == SOLVED))):
            break  # it asks for a check: all are searched again with it
        work = max(work, found.work[right].max(initial=0))
    else:
        return _spared(work), False
    work = taken = 0
    for _, found, right in _searches(problem, arithmetic, ENDLESS * CHECKS * most, True, rounded, best):
        work, taken = max(work, found.work[right].max(initial=0)), taken + int(found.work.sum())
        if _spared(work) == LONGEST or taken > ALTOGETHER:
            break
    return _spared(work), True


def _spared(work: int) -> int:
    return min(LONGEST, max(LEAST, int(np.ceil(SPARE * work))))


def _searches(
    problem: Quadratic, arithmetic: str, most: int, checked: bool, rounded: Raw, best: Solution
) -> Iterator[tuple[Solution, Solution, NDArray[np.bool_]]]:
    """Search some after others in an arithmetic; yield what float64 found, what this does, and which end alike."""
    rows = _with_work(problem, arithmetic, most, checked)
    for first in range(0, len(rounded), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        one = Solution(best.moves[part], best.status[part], best.work[part], best.side[part])
        yield one, *_tried(problem, rows, rounded[part], one)


def _with_work(problem: Quadratic, arithmetic: str, most: int, checked: bool) -> Rows:
    longest = min(LONGEST, max(LEAST, most))
    return rows_of(table_of(problem, arithmetic, "drawn", longest, checked), np.dtype(arithmetic))


def _tried(problem: Quadratic, rows: Rows, parameters: Raw, best: Solution) -> tuple[Solution, NDArray[np.bool_]]:
    """Search in the arithmetic of `rows`; return which searches end as `best` does."""
    known = best.status != CAPPED
    found = solve(rows, parameters)
    low, high = (ends[: len(problem.scale)] * problem.scale for ends in (problem.low, problem.high))
    away = np.abs(np.clip(found.moves, low, high) - np.clip(best.moves, low, high)).max(axis=1)
    near = (found.status != SOLVED) | (away <= NEAR * float(np.max(high - low)))
    return found, known & (found.status == best.status) & near
