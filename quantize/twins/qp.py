"""Solve a quadratic program with constant data by a dual active-set method: the twin of fl_qp.h, bit for bit.

The problem, in the rows y of its constraints alone (the unknowns are eliminated):

    y = slope p - gram m,    low <= y <= high,    m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i

with parameters p and multipliers m. It is the optimality condition of min 1/2 v'Hv + p'F'v, low <= Gv + Sp <= high, for
slope = S - G H^-1 F and gram = G H^-1 G' (Goldfarb and Idnani, Mathematical Programming 27, 1983), each row divided by
the root of its gram's diagonal, so that the most violated row is the one farthest from the optimum.

Every solve starts at the unconstrained optimum m = 0; where that keeps every limit it is the answer. Otherwise the most
violated row enters, rows whose multiplier would change its sign leave, until none is violated. Where no such set
exists, or the search takes too long, the unconstrained moves stand: with limits behind them, the saturated LQR. A start
from the active set of the sample before would take the columns of its rows all the same, and only spare rows that enter
and leave again, of which there are few: `bench/mpc/cart_pole.py` prints what even the right guess would spare.

What stands in `value` is m of a row in the active set and y of any other; both change along one column of the tableau,
which is taken from the gram's column through the pivots so far (product form: Dantzig and Orchard-Hays, 1954).

The tableau takes as many numbers as moves times limits. A program with many more rows than can be active keeps a factor
of the active ones instead (`qp_factor.py`, `fl_qp_many.h`), and all rows follow from the gram when one has entered.

`quantize/twins/qp_search.py` holds the steps; `fl_qp_search.h` is the same in C, step by step: every product is
rounded before it is added, the first of equal candidates is taken, and a row that is no number is never violated.

Where single precision is near its end (limits of moves and of their changes beside stiff soft ones), multipliers get so
large that y = slope p - gram m is known to 2^-10 at best. There a search is `checked`: rows count as violated beyond
what such multipliers round away, and what it ends with, or would call infeasible, is refined from the moves,
y = shift p + onward v - softness m, where nothing large cancels; the search goes on with what that finds. Where hard
limits of states can leave no moves, an answer that is not checked is believed only if its multipliers are known finely
enough to tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Quadratic
from firmloop.design.optimum import Solution
from firmloop.design.outcome import COLUMN

Raw = NDArray[Any]

FAR = 1e30  # a step that nothing stops, and a limit that is none
ENDLESS = 20  # times the square of what can be active: a search in float64 that works longer goes round in circles


@dataclass(frozen=True, slots=True)
class Rows:
    """One problem in its number format: `slope` (m, p), `low`, `high` (m,), `gram` (m, m), `scale` (k,).

    `scale` turns the first k rows into the moves; at most `room` rows are active; a row is violated beyond `tolerance`
    and, in a search, `share` of what the unconstrained optimum violates most; one whose pivot is below `least` depends
    on the active ones; `budget` is the work of one search at most. Where `moves` is not 0, answers are checked: rows
    are violated beyond `noise` of the largest multiplier, and refined until no move is corrected by `trusted` and no
    hard active row missed by `kept`; the rows behind the first `moves`, those of every move, are `shift` (c, p) of the
    parameters and `onward` (c, moves) of these, less `softness` (c,) of their multipliers. `many`: a search keeps a
    factor of the active rows, not a tableau of all.
    """

    slope: Raw
    low: Raw
    high: Raw
    gram: Raw
    scale: Raw
    tolerance: float
    share: float
    trusted: float
    kept: float
    noise: float
    least: float
    room: int
    budget: int
    moves: int
    shift: Raw
    onward: Raw
    softness: Raw
    many: bool = False

    @property
    def longest(self) -> int:
        """The work of a search that its budget ends, at most: a row that leaves, or a column and refinements, late."""
        if not self.moves:
            return self.budget + COLUMN + 2 * self.room
        return self.budget + 3 * COLUMN + 5 * self.room + 2 * self.moves


def exact(problem: Quadratic) -> Rows:
    """Make a problem ready for `solve` in float64, its search long enough for any that ends."""
    low, high = (np.clip(ends, -FAR, FAR) for ends in (problem.low, problem.high))
    tolerance, share, least = tolerance_of(problem) * 2.0**-40, 2.0**-46, 2.0**-36
    room, none = min(problem.freedom, len(low)), np.zeros((0, 0))
    budget = ENDLESS * (room + COLUMN) ** 2
    return Rows(
        problem.slope, low, high, problem.gram, problem.scale, tolerance, share, 0.0, FAR, 0.0, least, room, budget,
        0, none, none, np.zeros(0),
    )  # fmt: skip


def optimum(problem: Quadratic, parameters: Raw) -> Solution:
    """Solve in float64: what design asks for, a `QuadraticSolver`."""
    return solve(exact(problem), parameters)


def tolerance_of(problem: Quadratic) -> float:
    """Return the size of the limits, of which a share is the tolerance."""
    spans = (problem.high - problem.low)[np.isfinite(problem.high - problem.low)]
    return float(np.median(spans)) / 2 if len(spans) else 1.0


def solve(rows: Rows, parameters: Raw) -> Solution:
    """Solve for every row of `parameters` (lanes, p), in the element type of `rows`."""
    # Half a second, which only a search should cost.
    from firmloop.quantize.twins.qp_memory import QpProblem, memory_of
    from firmloop.quantize.twins.qp_search import search_all

    kind, count, lanes = rows.gram.dtype, len(rows.low), len(parameters)

    def typed(values: Raw) -> Raw:
        return np.ascontiguousarray(values, dtype=kind)

    problem = QpProblem(
        slope=typed(rows.slope.T),
        low=typed(rows.low),
        high=typed(rows.high),
        gram=typed(rows.gram),
        tolerance=kind.type(rows.tolerance),
        share=kind.type(rows.share),
        trusted=kind.type(rows.trusted),
        kept=kind.type(rows.kept),
        noise=kind.type(rows.noise),
        least=kind.type(rows.least),
        far=kind.type(FAR),
        none=kind.type(0),
        one=kind.type(1),
        room=rows.room,
        budget=rows.budget,
        moves=rows.moves,
        many=rows.many,
        shift=typed(rows.shift),
        onward=typed(rows.onward),
        softness=typed(rows.softness),
    )
    search = memory_of(count, rows.room, rows.many, kind)
    moves = np.zeros((lanes, len(rows.scale)), kind)
    status, work, side = np.zeros(lanes, np.int64), np.zeros(lanes, np.int64), np.zeros((lanes, count), np.int64)
    search_all(problem, search, typed(parameters), moves, status, work, side)
    return Solution(moves * typed(rows.scale), status, work, side)


def compile_search() -> None:
    """Compile the search for both element types, for which the first search on a machine waits ten seconds each."""
    none, one = np.zeros((0, 0)), np.ones(1)
    for kind in (np.float32, np.float64):
        gram = np.ones((1, 1), kind)
        solve(
            Rows(gram, -one, one, gram, one, 0.0, 0.0, 0.0, FAR, 0.0, 0.0, 1, 0, 0, none, none, np.zeros(0)),
            np.zeros((1, 1)),
        )
