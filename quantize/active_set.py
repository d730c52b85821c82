"""Solve a quadratic program with constant data by a dual active-set method, many parameters at once, bit for bit.

The problem, in the rows y of its constraints alone (the unknowns are eliminated):

    y = slope p - gram m,    low <= y <= high,    m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i

with parameters p and multipliers m. It is the optimality condition of min 1/2 v'Hv + p'F'v, low <= Gv + Sp <= high, for
slope = S - G H^-1 F and gram = G H^-1 G' (Goldfarb and Idnani, Mathematical Programming 27, 1983), each row divided by
the root of its gram's diagonal, so that the most violated row is the one farthest from the optimum.

Every solve starts at the unconstrained optimum m = 0; where that keeps every limit it is the answer. Otherwise the most
violated row enters, rows whose multiplier would change its sign leave, until none is violated. What stands in `value`
is m of a row in the active set and y of any other; both change along one column of the tableau, which is taken from the
gram's column through the pivots so far (product form of the inverse: Dantzig and Orchard-Hays, 1954).

`fl_qp.h` is the same in C, operation by operation: every product is rounded before it is added. What the two share
beyond the arithmetic: the first of equal candidates is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.law import Quadratic
from quantize.program import Table

Raw = NDArray[Any]

SOLVED, CAPPED, INFEASIBLE = 0, 1, 2
FAR = 1e30  # a step that nothing stops, and a limit that is none
TOLERANCE = {"float32": 2.0**-18, "float64": 2.0**-40}  # share of the limits by which a row may be violated
LEAST = {"float32": 2.0**-16, "float64": 2.0**-36}  # of a pivot, whose first value is 1
COLUMN = 6  # work of one column beside 1 for each active row, in the proportion of instructions
UNLIMITED = 10**9
CHUNK = 4096  # parameters solved at a time: their pivots stay within the processor's cache


@dataclass(frozen=True, slots=True)
class Rows:
    """One problem in its number format: `slope` (m, p), `low`, `high` (m,), `gram` (m, m), `scale` (k,).

    `scale` turns the first k rows into the moves; at most `room` rows are active; a row is violated beyond `tolerance`,
    and one whose pivot is below `least` depends on the active ones; `budget` is the work of one search at most.
    """

    slope: Raw
    low: Raw
    high: Raw
    gram: Raw
    scale: Raw
    tolerance: float
    least: float
    room: int
    budget: int


@dataclass(frozen=True, slots=True)
class Solution:
    """`moves` (lanes, k), `status` (lanes,), `work` (lanes,), and `side` (lanes, m): -1 at low, 1 at high, else 0."""

    moves: Raw
    status: NDArray[np.int64]
    work: NDArray[np.int64]
    side: NDArray[np.int64]


def table_of(problem: Quadratic, arithmetic: str, name: str, budget: int) -> Table:
    """Round a problem to "float32" or "float64"; its members are those of `fl_qp_t`."""
    kind = np.dtype(arithmetic).type
    count, parameters = problem.slope.shape
    width = -(-count // 4) * 4

    def rounded(values: Raw) -> tuple[float, ...]:
        return tuple(float(x) for x in np.clip(values, -FAR, FAR).astype(kind).ravel())

    sizes = {
        "FL_QP_ROWS": count,
        "FL_QP_WIDTH": width,
        "FL_QP_PARAMETERS": parameters,
        "FL_QP_MOVES": len(problem.scale),
        "FL_QP_ROOM": min(problem.freedom, count),
        "FL_QP_COLUMN": COLUMN,
        "FL_QP_BUDGET": budget,
    }
    spans = (problem.high - problem.low)[np.isfinite(problem.high - problem.low)]
    tolerance = TOLERANCE[arithmetic] * (float(np.median(spans)) / 2 if len(spans) else 1.0)
    numbers: dict[str, tuple[float, ...] | float] = {
        "slope": rounded(np.pad(problem.slope, ((0, width - count), (0, 0))).T),
        "low": rounded(problem.low),
        "high": rounded(problem.high),
        "gram": rounded(np.pad(problem.gram, ((0, 0), (0, width - count)))),
        "scale": rounded(problem.scale),
        "tolerance": float(kind(tolerance)),
        "least": float(kind(LEAST[arithmetic])),
        "far": float(kind(FAR)),
    }
    says = f"a quadratic program in {count} rows, {problem.freedom} unknowns and {parameters} parameters"
    return Table(name, says, "fl_qp_t", "fl_qp.h", tuple(sizes.items()), tuple(numbers.items()))


def rows_of(table: Table, kind: np.dtype[Any]) -> Rows:
    """Make a table ready for `solve`."""
    numbers = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    sizes = dict(table.sizes)
    count = sizes["FL_QP_ROWS"]
    gram = numbers["gram"].reshape(count, -1)
    slope = numbers["slope"].reshape(-1, gram.shape[1])[:, :count].T
    return Rows(
        slope, numbers["low"], numbers["high"], gram[:, :count], numbers["scale"],
        numbers["tolerance"].item(), numbers["least"].item(), sizes["FL_QP_ROOM"], sizes["FL_QP_BUDGET"],
    )  # fmt: skip


def exact(problem: Quadratic) -> Rows:
    """Make a problem ready for `solve` as the law has it, in float64."""
    return rows_of(table_of(problem, "float64", "exact", UNLIMITED), np.dtype(np.float64))


def solve(rows: Rows, parameters: Raw) -> Solution:
    """Solve for every row of `parameters` (lanes, p), in the element type of `rows`."""
    with np.errstate(all="ignore"):
        parts = [_chunk(rows, parameters[at : at + CHUNK]) for at in range(0, max(1, len(parameters)), CHUNK)]
    return Solution(
        np.concatenate([part.moves for part in parts]),
        np.concatenate([part.status for part in parts]),
        np.concatenate([part.work for part in parts]),
        np.concatenate([part.side for part in parts]),
    )


def _chunk(rows: Rows, parameters: Raw) -> Solution:
    value = rows.slope[:, 0] * parameters[:, :1]
    for k in range(1, rows.slope.shape[1]):
        value = value + rows.slope[:, k] * parameters[:, k : k + 1]
    excess = np.maximum(value - rows.high, rows.low - value)
    broken = np.flatnonzero(excess.max(axis=1) > rows.tolerance)
    status, work = np.zeros(len(value), np.int64), np.zeros(len(value), np.int64)
    side = np.zeros(value.shape, np.int64)
    moves = value[:, : len(rows.scale)].copy()
    if len(broken):
        search = _Search(rows, value[broken], excess[broken].argmax(axis=1))
        search.run()
        status[broken], work[broken], side[broken] = search.status, search.work, search.side
        ends = np.where(search.side > 0, rows.high, np.where(search.side < 0, rows.low, search.value))
        moves[broken] = ends[:, : len(rows.scale)]
    return Solution(moves * rows.scale, status, work, side)


class _Search:
    """The lanes whose unconstrained optimum breaks a limit; each round takes one step of every lane not yet done."""

    def __init__(self, rows: Rows, value: Raw, entering: NDArray[np.int64]) -> None:
        lanes, width = value.shape
        kind = value.dtype
        self.rows, self.value, self.kind = rows, value, kind
        self.eta = np.zeros((rows.room, lanes, width), kind)
        self.pivot = np.zeros((rows.room, lanes), kind)
        self.active = np.zeros((lanes, rows.room), np.int64)
        self.length = np.zeros(lanes, np.int64)  # of the active set
        self.side = np.zeros((lanes, width), np.int64)
        self.status, self.work = np.full(lanes, -1), np.zeros(lanes, np.int64)
        self.entering = entering
        self.sign, self.limit = np.zeros(lanes, kind), np.zeros(lanes, kind)
        self.multiplier = np.zeros(lanes, kind)

    def run(self) -> None:
        """Search until every lane has a status."""
        lanes = np.arange(len(self.value))
        self._enter(lanes)
        while len(lanes):
            self.status[lanes[self.work[lanes] >= self.rows.budget]] = CAPPED
            lanes = lanes[self.status[lanes] < 0]
            column = self._column(lanes, self.entering[lanes])
            leaving = self._step(lanes, column)
            stays = self.status[lanes] < 0
            lanes, leaving, column = lanes[stays], leaving[stays], column[stays]
            self._leave(lanes[leaving >= 0], leaving[leaving >= 0])
            joining = lanes[leaving < 0]
            self._join(joining, column[leaving < 0])
            joining = joining[self.status[joining] < 0]
            self._select(joining)
            self._enter(joining[self.status[joining] < 0])
            lanes = lanes[self.status[lanes] < 0]

    def _enter(self, lanes: NDArray[np.int64]) -> None:
        """Take the side on which the entering row is violated."""
        row = self.entering[lanes]
        above = self.value[lanes, row] > self.rows.high[row]
        self.sign[lanes] = np.where(above, 1, -1)
        self.limit[lanes] = np.where(above, self.rows.high[row], self.rows.low[row])
        self.multiplier[lanes] = 0

    def _column(self, lanes: NDArray[np.int64], row: NDArray[np.int64]) -> Raw:
        """Return the tableau's column (lanes, m) of a multiplier that is zero.

        The gram is symmetric, and so is what it becomes: what an eta takes from this column in its pivot row is what
        it holds in this row.
        """
        column = self.rows.gram[row]
        self.work[lanes] += self.length[lanes] + COLUMN
        for k in range(int(self.length[lanes].max(initial=0))):
            here = np.flatnonzero(self.length[lanes] > k)
            whose = lanes[here]
            eta = self.eta[k, whose]
            factor = eta[np.arange(len(here)), row[here]] * self.pivot[k, whose]
            column[here] = column[here] - eta * factor[:, None]
        return column

    def _step(self, lanes: NDArray[np.int64], column: Raw) -> NDArray[np.int64]:
        """Go as far as the entering row's limit or the first multiplier at zero; return that place, or -1."""
        row, sign = self.entering[lanes], self.sign[lanes]
        pivot = column[np.arange(len(lanes)), row]
        gap = (self.value[lanes, row] - self.limit[lanes]) * sign
        step = np.where(pivot > self.rows.least, gap / pivot, self.kind.type(FAR))
        place = np.arange(self.active.shape[1])
        active = self.active[lanes]
        which = np.arange(len(lanes))[:, None]
        toward = self.side[lanes][which, active].astype(self.kind)
        rate = column[which, active] * (sign[:, None] * toward)
        ratio = self.value[lanes][which, active] * toward / rate
        stops = (place < self.length[lanes][:, None]) & (rate > self.rows.least)
        ratio = np.where(stops, ratio, self.kind.type(FAR))
        first = ratio.argmin(axis=1)
        nearest = ratio[np.arange(len(lanes)), first]
        leaving = np.where(nearest < step, first, -1)
        step = np.where(nearest < step, nearest, step)
        self.status[lanes[step >= FAR]] = INFEASIBLE
        going = step < FAR
        lanes = lanes[going]
        moved = step[going] * sign[going]
        self.value[lanes] = self.value[lanes] - column[going] * moved[:, None]
        self.multiplier[lanes] = self.multiplier[lanes] + moved
        return leaving

    def _leave(self, lanes: NDArray[np.int64], place: NDArray[np.int64]) -> None:
        """Take the row at `place` out of the active set; those that came after it are put in again."""
        row = self.active[lanes, place]
        self.value[lanes, row] = np.where(self.side[lanes, row] > 0, self.rows.high[row], self.rows.low[row])
        self.side[lanes, row] = 0
        last = self.length[lanes] - 1
        self.length[lanes] = place
        while len(lanes):
            more = (self.length[lanes] < last) & (self.status[lanes] < 0)
            lanes, last = lanes[more], last[more]
            again = self.active[lanes, np.minimum(self.length[lanes] + 1, self.rows.room - 1)]
            self._store(lanes, again, self._column(lanes, again))

    def _join(self, lanes: NDArray[np.int64], column: Raw) -> None:
        """Put the entering row into the active set."""
        row = self.entering[lanes]
        self.side[lanes, row] = self.sign[lanes].astype(np.int64)
        self.value[lanes, row] = self.multiplier[lanes]
        self._store(lanes, row, column)

    def _store(self, lanes: NDArray[np.int64], row: NDArray[np.int64], column: Raw) -> None:
        """Keep the pivot of `column` (lanes, m) in `row`; too small a one, a full set or too much work ends it all."""
        pivot = column[np.arange(len(lanes)), row]
        good = (pivot > self.rows.least) & (self.length[lanes] < self.rows.room)
        good &= self.work[lanes] < self.rows.budget
        self.status[lanes[~good]] = CAPPED
        lanes, row, column, pivot = lanes[good], row[good], column[good], pivot[good]
        k = self.length[lanes]
        inverse = self.kind.type(1) / pivot
        eta = column * inverse[:, None]
        eta[np.arange(len(lanes)), row] = self.kind.type(1) - inverse  # leaves pivot / pivot in that row
        self.eta[k, lanes] = eta
        self.pivot[k, lanes] = pivot
        self.active[lanes, k] = row
        self.length[lanes] = k + 1

    def _select(self, lanes: NDArray[np.int64]) -> None:
        """Find the most violated row outside the active set; where none is, the lane is solved."""
        value = self.value[lanes]
        excess = np.maximum(value - self.rows.high, self.rows.low - value)
        excess = np.where(self.side[lanes] == 0, excess, -1)
        self.entering[lanes] = excess.argmax(axis=1)
        self.status[lanes[~(excess.max(axis=1) > self.rows.tolerance)]] = SOLVED
