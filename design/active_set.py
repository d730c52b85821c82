"""Solve a quadratic program with constant data by a dual active-set method, many parameters at once, bit for bit.

The problem, in the rows y of its constraints alone (the unknowns are eliminated):

    y = slope p - gram m,    low <= y <= high,    m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i

with parameters p and multipliers m. It is the optimality condition of min 1/2 v'Hv + p'F'v, low <= Gv + Sp <= high, for
slope = S - G H^-1 F and gram = G H^-1 G' (Goldfarb and Idnani, Mathematical Programming 27, 1983), each row divided by
the root of its gram's diagonal, so that the most violated row is the one farthest from the optimum.

Every solve starts at the unconstrained optimum m = 0; where that keeps every limit it is the answer. Otherwise the most
violated row enters, rows whose multiplier would change its sign leave, until none is violated. Where no such set
exists, or the search takes too long, the unconstrained moves stand: with limits behind them, the saturated LQR. A start
from the active set of the sample before would take the columns of its rows all the same, and only spare rows that enter
and leave again, of which there are few: `bench/mpc.py` prints what even the right guess would spare.

What stands in `value` is m of a row in the active set and y of any other; both change along one column of the tableau,
which is taken from the gram's column through the pivots so far (product form: Dantzig and Orchard-Hays, 1954).

`fl_qp.h` is the same in C, operation by operation: every product is rounded before it is added. What the two share
beyond the arithmetic: the first of equal candidates is taken, and a row that is no number is never violated.

Where single precision is near its end (limits of moves and of their changes beside stiff soft ones), multipliers get so
large that y = slope p - gram m is known to 2^-10 at best. There a search is `checked`: rows count as violated beyond
what such multipliers round away, and what it ends with, or would call infeasible, is refined from the moves,
y = shift p + onward v - softness m, where nothing large cancels; the search goes on with what that finds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.law import Quadratic

Raw = NDArray[Any]

SOLVED, CAPPED, INFEASIBLE = 0, 1, 2
FAR = 1e30  # a step that nothing stops, and a limit that is none
COLUMN = 6  # work of one column beside 1 for each active row, in the proportion of instructions
UNLIMITED = 10**9
CACHED = 2**21  # numbers of the pivots of the parameters solved at a time: they stay within the processor's cache


@dataclass(frozen=True, slots=True)
class Rows:
    """One problem in its number format: `slope` (m, p), `low`, `high` (m,), `gram` (m, m), `scale` (k,).

    `scale` turns the first k rows into the moves; at most `room` rows are active; a row is violated beyond `tolerance`
    and, in a search, `share` of what the unconstrained optimum violates most; one whose pivot is below `least` depends
    on the active ones; `budget` is the work of one search at most. Where `moves` is not 0, answers are checked: rows
    are violated beyond `noise` of the largest multiplier, and refined until no move is corrected by `trusted`; the rows
    behind the first `moves`, those of every move, are `shift` (c, p) of the parameters and `onward` (c, moves) of
    these, less `softness` (c,) of their multipliers.
    """

    slope: Raw
    low: Raw
    high: Raw
    gram: Raw
    scale: Raw
    tolerance: float
    share: float
    trusted: float
    noise: float
    least: float
    room: int
    budget: int
    moves: int
    shift: Raw
    onward: Raw
    softness: Raw

    @property
    def longest(self) -> int:
        """The work of a search that its budget ends, at most: a row that leaves, or a column and refinements, late."""
        if not self.moves:
            return self.budget + COLUMN + 2 * self.room
        return self.budget + 3 * COLUMN + 5 * self.room + 2 * self.moves


@dataclass(frozen=True, slots=True)
class Solution:
    """`moves` (lanes, k), `status` (lanes,), `work` (lanes,), and `side` (lanes, m): -1 at low, 1 at high, else 0."""

    moves: Raw
    status: NDArray[np.int64]
    work: NDArray[np.int64]
    side: NDArray[np.int64]


def exact(problem: Quadratic) -> Rows:
    """Make a problem ready for `solve` in float64, its search unlimited."""
    low, high = (np.clip(ends, -FAR, FAR) for ends in (problem.low, problem.high))
    tolerance, share, least = tolerance_of(problem) * 2.0**-40, 2.0**-46, 2.0**-36
    room, none = min(problem.freedom, len(low)), np.zeros((0, 0))
    return Rows(
        problem.slope, low, high, problem.gram, problem.scale, tolerance, share, 0.0, 0.0, least, room, UNLIMITED,
        0, none, none, np.zeros(0),
    )  # fmt: skip


def tolerance_of(problem: Quadratic) -> float:
    """Return the size of the limits, of which a share is the tolerance."""
    spans = (problem.high - problem.low)[np.isfinite(problem.high - problem.low)]
    return float(np.median(spans)) / 2 if len(spans) else 1.0


def solve(rows: Rows, parameters: Raw) -> Solution:
    """Solve for every row of `parameters` (lanes, p), in the element type of `rows`."""
    lanes = max(1, CACHED // (max(1, rows.room) * len(rows.low)))
    with np.errstate(all="ignore"):
        parts = [_chunk(rows, parameters[at : at + lanes]) for at in range(0, max(1, len(parameters)), lanes)]
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
    excess = _excess(rows, value)
    broken = np.flatnonzero(excess.max(axis=1) > rows.tolerance)
    status, work = np.zeros(len(value), np.int64), np.zeros(len(value), np.int64)
    side = np.zeros(value.shape, np.int64)
    moves = value[:, : len(rows.scale)].copy()
    if len(broken):
        search = _Search(rows, parameters[broken], value[broken], excess[broken])
        search.run()
        status[broken], work[broken], side[broken] = search.status, search.work, search.side
        ends = np.where(search.side > 0, rows.high, np.where(search.side < 0, rows.low, search.value))
        found = search.status == SOLVED
        moves[broken[found]] = ends[found, : len(rows.scale)]
    return Solution(moves * rows.scale, status, work, side)


def _excess(rows: Rows, value: Raw) -> Raw:
    """Return by how much each row is violated, -1 or more; a row that is no number is not."""
    least: Raw = np.fmax(np.maximum(value - rows.high, rows.low - value), -1)
    return least


class _Search:
    """The lanes whose unconstrained optimum breaks a limit; each round takes one step of every lane not yet done."""

    def __init__(self, rows: Rows, parameters: Raw, value: Raw, excess: Raw) -> None:
        lanes, width = value.shape
        kind = value.dtype
        self.rows, self.parameters, self.value, self.kind = rows, parameters, value, kind
        self.eta = np.zeros((rows.room, lanes, width), kind)
        self.pivot = np.zeros((rows.room, lanes), kind)
        self.active = np.zeros((lanes, rows.room), np.int64)
        self.length = np.zeros(lanes, np.int64)  # of the active set
        self.side = np.zeros((lanes, width), np.int64)
        self.status, self.work = np.full(lanes, -1), np.zeros(lanes, np.int64)
        self.entering, self.column = excess.argmax(axis=1), np.zeros_like(value)
        self.tolerance = kind.type(rows.tolerance) + excess.max(axis=1) * kind.type(rows.share)
        self.sign, self.limit = np.zeros(lanes, kind), np.zeros(lanes, kind)
        self.multiplier = np.zeros(lanes, kind)
        self.fresh = np.zeros(lanes, bool)  # refined since the last row that joined
        self.hard = np.concatenate([np.ones(rows.moves, bool), ~(rows.softness > 0)])  # where answers are checked
        self.filled = np.zeros(lanes, np.int64)  # active rows that are hard

    def run(self) -> None:
        """Search until every lane has a status."""
        lanes = np.arange(len(self.value))
        self._approach(lanes)
        while len(lanes):
            lanes = lanes[self.status[lanes] < 0]
            self.status[lanes[self.work[lanes] >= self.rows.budget]] = CAPPED
            lanes = lanes[self.status[lanes] < 0]
            leaving = self._step(lanes)
            stays = self.status[lanes] < 0
            lanes, leaving = lanes[stays], leaving[stays]
            self._leave(lanes[leaving >= 0], leaving[leaving >= 0])
            joining = lanes[leaving < 0]
            self._join(joining)
            self._select(joining, self.tolerance[joining])
            if self.rows.moves:
                self._settle(joining[self.status[joining] == SOLVED])
            self._approach(joining[self.status[joining] < 0])
            lanes = lanes[self.status[lanes] < 0]

    def _approach(self, lanes: NDArray[np.int64]) -> None:
        """Enter the rows selected; where answers are checked, refine first before one that depends on the active."""
        while len(lanes):
            self._enter(lanes)
            if not self.rows.moves:
                return
            lanes = lanes[~self.fresh[lanes] & ~self._free(lanes)]
            self.fresh[lanes] = self._refine(lanes)
            self.status[lanes[self.work[lanes] >= self.rows.budget]] = CAPPED
            self._settle(lanes[self.status[lanes] == SOLVED])
            lanes = lanes[self.status[lanes] < 0]

    def _settle(self, lanes: NDArray[np.int64]) -> None:
        """Refine until no move is corrected any more, or a row is violated after all."""
        while len(lanes):
            far = ~self._refine(lanes)
            self.status[lanes[far & (self.work[lanes] >= self.rows.budget)]] = CAPPED
            lanes = lanes[far & (self.status[lanes] == SOLVED)]

    def _refine(self, lanes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Correct moves and multipliers by what the problem's own numbers say of them, and select again.

        The residual goes through the etas as a column does: what becomes of it in an active row is what its multiplier
        lacks, in any other what its value lacks. Returns where no move was corrected by `trusted` or more.
        """
        rows, moves = self.rows, self.rows.moves
        self.status[lanes] = -1
        self.work[lanes] += 2 * self.length[lanes] + moves + COLUMN
        held = self._held(lanes)
        error = self._residual(lanes, held)
        for k in range(int(self.length[lanes].max(initial=0))):
            here = np.flatnonzero(self.length[lanes] > k)
            error[here] = error[here] - self.eta[k, lanes[here]] * error[here, self.active[lanes[here], k]][:, None]
        self.value[lanes] = self.value[lanes] + error
        free = self.side[lanes] == 0
        near = (error[:, :moves] < rows.trusted) & (error[:, :moves] > -rows.trusted)
        beyond = self._beyond(lanes, np.where(free, self.value[lanes], held)[:, :moves])
        self.value[lanes, moves:] = np.where(free[:, moves:], beyond, self.value[lanes, moves:])
        self._select(lanes, np.full(len(lanes), rows.tolerance, self.kind))
        return np.asarray(np.all(near | ~free[:, :moves], axis=1))

    def _held(self, lanes: NDArray[np.int64]) -> Raw:
        """Return where each row is taken to be: an active one at its limit."""
        side = self.side[lanes]
        return np.where(side > 0, self.rows.high, np.where(side < 0, self.rows.low, self.value[lanes]))

    def _beyond(self, lanes: NDArray[np.int64], moves: Raw) -> Raw:
        """Return the rows behind those of the moves, from the moves (lanes, moves)."""
        value = self.rows.shift[:, 0] * self.parameters[lanes, :1]
        for j in range(1, self.parameters.shape[1]):
            value = value + self.rows.shift[:, j] * self.parameters[lanes, j : j + 1]
        for j in range(moves.shape[1]):
            value = value + self.rows.onward[:, j] * moves[:, j : j + 1]
        return value

    def _residual(self, lanes: NDArray[np.int64], held: Raw) -> Raw:
        """Return by how much each row is beyond where it is taken to be: the moves that the multipliers ask for."""
        moves = self.rows.moves
        value = self.rows.slope[:moves, 0] * self.parameters[lanes, :1]
        for j in range(1, self.parameters.shape[1]):
            value = value + self.rows.slope[:moves, j] * self.parameters[lanes, j : j + 1]
        for k in range(int(self.length[lanes].max(initial=0))):
            here = np.flatnonzero(self.length[lanes] > k)
            row = self.active[lanes[here], k]
            value[here] = value[here] - self.rows.gram[row, :moves] * self.value[lanes[here], row][:, None]
        beyond = self._beyond(lanes, value)
        soft = beyond - self.rows.softness * self.value[lanes, moves:]
        beyond = np.where(self.side[lanes, moves:] != 0, soft, beyond)
        return np.concatenate([value, beyond], axis=1) - held

    def _enter(self, lanes: NDArray[np.int64]) -> None:
        """Take the side on which the entering row is violated, and the tableau's column of its multiplier."""
        row = self.entering[lanes]
        above = self.value[lanes, row] > self.rows.high[row]
        self.sign[lanes] = np.where(above, 1, -1)
        self.limit[lanes] = np.where(above, self.rows.high[row], self.rows.low[row])
        self.multiplier[lanes] = 0
        self._column(lanes, row)

    def _column(self, lanes: NDArray[np.int64], row: NDArray[np.int64]) -> None:
        """Take the tableau's column of a multiplier that is zero.

        The gram is symmetric, and so is what it becomes: what an eta takes from this column in its pivot row is what
        it holds in this row. So all that is taken is known at once; it is taken one eta after the other.
        """
        length = self.length[lanes]
        self.work[lanes] += length + COLUMN
        places = np.arange(int(length.max(initial=0)))
        eta = self.eta[: len(places), lanes]
        factor = eta[:, np.arange(len(lanes)), row] * self.pivot[: len(places), lanes]
        taken = np.where((places[:, None] < length)[:, :, None], eta * factor[:, :, None], self.kind.type(0))
        self.column[lanes] = np.subtract.reduce(np.concatenate([self.rows.gram[row][None], taken]), axis=0)

    def _free(self, lanes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return where the entering row does not depend on the active ones: no more hard ones than moves are free."""
        row = self.entering[lanes]
        free = (self.column[lanes, row] > self.rows.least) & (self.length[lanes] < self.rows.room)
        if self.rows.moves:
            free &= ~(self.hard[row] & (self.filled[lanes] == self.rows.moves))
        return np.asarray(free)

    def _step(self, lanes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Go as far as the entering row's limit or the first multiplier at zero; return that place, or -1."""
        column = self.column[lanes]
        row, sign = self.entering[lanes], self.sign[lanes]
        pivot = column[np.arange(len(lanes)), row]
        gap = (self.value[lanes, row] - self.limit[lanes]) * sign
        step = np.where(self._free(lanes), gap / pivot, self.kind.type(FAR))
        length = self.length[lanes][:, None]
        place = np.arange(max(1, int(length.max(initial=0))))
        active, which = self.active[lanes, : len(place)], lanes[:, None]
        toward = self.side[which, active].astype(self.kind)
        rate = self.column[which, active] * (sign[:, None] * toward)
        ratio = self.value[which, active] * toward / rate
        stops = (place < length) & (rate > self.rows.least)
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
        """Take the row at `place` out of the active set: out of every eta after its own, and out of the column.

        `out`, the tableau's column of that row without it, moves through the places; the eta it meets is put before it.
        """
        if not len(lanes):
            return
        row, which = self.active[lanes, place], np.arange(len(lanes))
        last = self.length[lanes] - 1
        self.value[lanes, row] = np.where(self.side[lanes, row] > 0, self.rows.high[row], self.rows.low[row])
        self.side[lanes, row] = 0
        self.length[lanes] = last
        if self.rows.moves:
            self.filled[lanes] -= self.hard[row]
        self.work[lanes] += COLUMN + 2 * (last - place)
        out = self.eta[place, lanes] * self.pivot[place, lanes][:, None]
        out[which, row] = self.pivot[place, lanes]
        for k in range(int(place.min()) + 1, int(last.max()) + 1):
            here = np.flatnonzero((place < k) & (k <= last))
            out[here] = self._past(lanes[here], k, row[here], out[here])
        factor = self.column[lanes, row]
        self.column[lanes] = self.column[lanes] + out * factor[:, None]
        self.column[lanes, row] = factor * out[which, row]

    def _past(self, lanes: NDArray[np.int64], k: int, row: NDArray[np.int64], out: Raw) -> Raw:
        """Put the eta at place `k` before `out` (lanes, m), the column of `row`; return what `out` becomes."""
        which, at, eta = np.arange(len(lanes)), self.active[lanes, k], self.eta[k, lanes]
        held, taken, rest = eta[which, row], out[which, at], out[which, row]
        before = self.pivot[k, lanes]
        pivot = before + taken * (held * before)
        share, inverse = before / pivot, self.kind.type(1) / pivot
        left = held * rest * share
        eta = (eta + out * held[:, None]) * share[:, None]
        out = out - eta * taken[:, None]
        eta[which, at], out[which, at] = self.kind.type(1) - inverse, taken * inverse
        eta[which, row], out[which, row] = left, rest - left * taken
        self.eta[k - 1, lanes], self.pivot[k - 1, lanes], self.active[lanes, k - 1] = eta, pivot, at
        return out

    def _join(self, lanes: NDArray[np.int64]) -> None:
        """Put the entering row, which does not depend on the others, into the active set."""
        row = self.entering[lanes]
        self.side[lanes, row] = self.sign[lanes].astype(np.int64)
        self.value[lanes, row] = self.multiplier[lanes]
        pivot, k = self.column[lanes, row], self.length[lanes]
        inverse = self.kind.type(1) / pivot
        eta = self.column[lanes] * inverse[:, None]
        eta[np.arange(len(lanes)), row] = self.kind.type(1) - inverse  # leaves pivot / pivot in that row
        self.eta[k, lanes], self.pivot[k, lanes], self.active[lanes, k] = eta, pivot, row
        self.length[lanes] = k + 1
        if self.rows.moves:
            noise = self.multiplier[lanes] * self.sign[lanes] * self.kind.type(self.rows.noise)
            self.tolerance[lanes] = np.where(noise > self.tolerance[lanes], noise, self.tolerance[lanes])
            self.fresh[lanes] = False
            self.filled[lanes] += self.hard[row]

    def _select(self, lanes: NDArray[np.int64], tolerance: Raw) -> None:
        """Find the most violated row outside the active set; where none is, the lane is solved."""
        excess = np.where(self.side[lanes] == 0, _excess(self.rows, self.value[lanes]), -1)
        self.entering[lanes] = excess.argmax(axis=1)
        self.status[lanes[~(excess.max(axis=1) > tolerance)]] = SOLVED
