"""One real-time iteration of nonlinear predictive control, for many controllers at once, bit for bit.

    min 1/2 sum (x - t)'Q(x - t) + (u - r)'R(u - r) + d'S d,   d[k] = u[k] - u[k-1],   P instead of Q at the end
    x[k+1] = step(x[k], u[k]),   low <= u <= high,   x_low <= x <= x_high for some states

The unknowns are the moves u[0..N-1] and the states x[1..N] between them (multiple shooting: Bock and Plitt, IFAC World
Congress 1984). Each sample takes one Gauss-Newton step of sequential quadratic programming from the plan of the sample
before, moved up by one (real-time iteration: Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005); where there
is none, from the states that the moves lead to. The steps of the states are eliminated column by column, the rest is

    min 1/2 v'Hv + g'v,   low <= G v <= high,   H = L D L'

and solved by the dual active-set method of `active_set.py`, on a tableau: y = y0 - T m, the rows y of the limits
against their multipliers m, T = G H^-1 G'. A row that enters or leaves the active set is a pivot of the tableau
(principal pivoting: Cottle, Pang and Stone, The Linear Complementarity Problem, 1992). What is found counts only where
it meets the optimality conditions of the problem's own H, g and G.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.law import Horizon

Raw = NDArray[Any]
Model = Callable[[Sequence[Raw]], Sequence[Raw]]  # x and u -> x of the next sample, then its slopes row by row

SOLVED, CAPPED, INFEASIBLE = 0, 1, 2
FAR = 1e30  # a step that nothing stops, and a limit that is none
CHUNK = 256  # lanes at a time: their tableaus stay within the processor's cache
MANY = 500  # sums at a time from which on each addend of all of them is one operation


@dataclass(frozen=True, slots=True)
class Course:
    """A problem in its number format; n states, m inputs, c states with limits.

    A row is violated beyond `tolerance` of its span (`weight` is one over that: of each input, then of each limited
    state); an answer counts where it is within `trusted` spans of optimal; a pivot below `least` of its first value
    depends on the active rows.
    """

    q: Raw  # (n, n)
    r: Raw  # (m, m)
    p: Raw  # (n, n)
    change: Raw  # (m,), the diagonal of S
    rest: Raw  # (m,)
    low: Raw  # (m + c,)
    high: Raw
    weight: Raw
    limited: tuple[int, ...]  # those c states
    length: int
    iterations: int
    budget: int  # pivots of one iteration
    tolerance: float
    trusted: float
    least: float

    @property
    def unknowns(self) -> int:
        """Moves of the whole horizon."""
        return self.length * len(self.r)

    @property
    def rows(self) -> int:
        """Limits of moves, then of states."""
        return self.unknowns + self.length * len(self.limited)


def course_of(problem: Horizon, kind: np.dtype[Any], tolerance: float, trusted: float, least: float) -> Course:
    """Round a problem to a number format."""
    low, high, weight = (np.clip(part, -FAR, FAR).astype(kind) for part in (problem.low, problem.high, problem.weight))
    return Course(
        problem.q.astype(kind), problem.r.astype(kind), problem.p.astype(kind), problem.change.astype(kind),
        problem.rest.astype(kind), low, high, weight, problem.limited, problem.length, problem.iterations,
        problem.budget, float(kind.type(tolerance)), float(kind.type(trusted)), float(kind.type(least)),
    )  # fmt: skip


def improve(course: Course, model: Model, parameters: Raw) -> tuple[Raw, NDArray[np.int64]]:
    """Return the results (lanes, k) and the status (lanes,) for `parameters` (lanes, p).

    Parameters are x[0], t, the last output, 1 where there is a plan, x[1..N] and u[0..N-1] of that plan. Results are
    the outputs, 1 where there is a plan for the next sample, the largest change of a move in its span, and that plan.
    """
    parts = [_chunk(course, model, parameters[at : at + CHUNK]) for at in range(0, max(1, len(parameters)), CHUNK)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _chunk(course: Course, model: Model, parameters: Raw) -> tuple[Raw, NDArray[np.int64]]:
    n, m, length = len(course.q), len(course.r), course.length
    edges = np.cumsum([n, n, m, 1, length * n])
    first, target, last, planned, states, moves = np.split(parameters, edges, axis=1)
    with np.errstate(all="ignore"):
        warm = planned[:, 0] > 0
        x = np.concatenate([first, states], axis=1).reshape(-1, length + 1, n)
        u = np.where(warm[:, None], moves, parameters.dtype.type(0)).reshape(-1, length, m)
        run = _Iteration(course, model, target, last, x, u)
        for _ in range(course.iterations):
            run.iterate(warm)
            warm = np.ones_like(warm)
        return run.results(), run.status


class _Iteration:
    """The plan of every lane: states x (lanes, N + 1, n), moves u (lanes, N, m)."""

    def __init__(self, course: Course, model: Model, target: Raw, last: Raw, x: Raw, u: Raw) -> None:
        self.course, self.model = course, model
        self.target, self.last, self.x, self.u = target, last, x.copy(), u.copy()
        self.lanes, self.kind = len(x), x.dtype.type
        self.status = np.zeros(self.lanes, np.int64)
        self.largest = np.zeros(self.lanes, x.dtype)
        self.fallback = np.zeros((self.lanes, len(course.r)), x.dtype)
        self.zero = np.zeros(self.lanes, x.dtype)

    def iterate(self, warm: NDArray[np.bool_]) -> None:
        """Take one step of every lane that has not failed."""
        self._linearize(warm)
        self._gradient()
        self._hessian()
        factored = self._factor()
        search = _Search(self)
        outcome = np.where(factored, search.run(factored), CAPPED)
        step = search.moves()
        outcome = np.where((outcome == SOLVED) & ~self._optimal(step, search), CAPPED, outcome)
        going = self.status == SOLVED
        finite = self.zero.copy()
        for j in range(self.x.shape[2]):
            finite = finite + (self.x[:, 0, j] - self.x[:, 0, j])
        m = self.u.shape[2]
        free = np.where(factored[:, None], search.free[:, :m], finite[:, None])
        self.fallback = np.where(going[:, None], self.u[:, 0] + free, self.fallback)
        self.status = np.where(going, outcome, self.status)
        self._advance(step, self.status == SOLVED)

    def _linearize(self, warm: NDArray[np.bool_]) -> None:
        """Take the slopes along the plan and what it lacks, d = step(x[k], u[k]) - x[k+1]."""
        lanes, length, m = self.u.shape
        n = self.x.shape[2]
        if not np.all(warm):
            for k in range(length):
                found = self._modeled(self.x[:, k], self.u[:, k])[..., :n]
                self.x[:, k + 1] = np.where(warm[:, None], self.x[:, k + 1], found)
        found = self._modeled(self.x[:, :-1].reshape(-1, n), self.u.reshape(-1, m)).reshape(lanes, length, -1)
        slopes = found[..., n:].reshape(lanes, length, n, n + m)
        self.a, self.b = slopes[..., :n], slopes[..., n:]
        self.d = found[..., :n] - self.x[:, 1:]
        self.e = self.x.copy()  # the states that the plan's moves lead to, linearized
        s = np.zeros((lanes, n), self.x.dtype)
        for k in range(length):
            s = _sum(self.d[:, k], self.a[:, k] * s[:, None])
            self.e[:, k + 1] = self.x[:, k + 1] + s

    def _modeled(self, x: Raw, u: Raw) -> Raw:
        found = self.model([*x.T, *u.T])
        return np.stack([np.broadcast_to(part, len(x)) for part in found], axis=1)

    def _gradient(self) -> None:
        own, (lanes, length, m) = self.course, self.u.shape
        g = np.empty((lanes, length, m), self.x.dtype)
        slope = _product(own.p, self.e[:, length] - self.target)
        for k in range(length - 1, -1, -1):
            row = _product(own.r, self.u[:, k] - own.rest)
            g[:, k] = _sum(row, self.b[:, k].swapaxes(1, 2) * slope[:, None])
            before = _product(own.q, self.e[:, k] - self.target)
            slope = _sum(before, self.a[:, k].swapaxes(1, 2) * slope[:, None])
        for k in range(length):
            g[:, k] = g[:, k] + own.change * (self.u[:, k] - (self.u[:, k - 1] if k else self.last))
            if k + 1 < length:
                g[:, k] = g[:, k] - own.change * (self.u[:, k + 1] - self.u[:, k])
        self.g = g.reshape(lanes, -1)

    def _hessian(self) -> None:
        """Send every move through the horizon, and what it changes there back to the moves before."""
        own, (lanes, length, m) = self.course, self.u.shape
        n, size = len(own.q), own.unknowns
        w = np.zeros((lanes, length + 1, size, n), self.x.dtype)  # of each state by each move
        for k in range(length):
            done = k * m
            if done:
                w[:, k + 1, :done] = _turned(self.a[:, k], w[:, k, :done])
            w[:, k + 1, done : done + m] = self.b[:, k].swapaxes(1, 2)
        h = np.zeros((lanes, size, size), self.x.dtype)
        slope = _turned(np.broadcast_to(own.p, (lanes, n, n)), w[:, length])
        for k in range(length - 1, -1, -1):
            done = k * m
            rows = _turned(self.b[:, k].swapaxes(1, 2), slope[:, : done + m])
            rows[:, done:] = rows[:, done:] + own.r.T
            h[:, done : done + m, : done + m] = rows.swapaxes(1, 2)
            if done:
                back = _turned(np.broadcast_to(own.q, (lanes, n, n)), w[:, k, :done])
                slope = _sum(back, self.a[:, k, None].swapaxes(2, 3) * slope[:, :done, None])
        for k in range(length):
            here = np.arange(k * m, k * m + m)
            h[:, here, here] = h[:, here, here] + (own.change + own.change if k + 1 < length else own.change)
            if k + 1 < length:
                h[:, here + m, here] = h[:, here + m, here] - own.change
        self.h = h
        self.rows = np.zeros((lanes, own.rows, size), self.x.dtype)
        self.rows[:, :size] = np.eye(size)
        if own.limited:
            self.rows[:, size:] = w[:, 1:, :, own.limited].swapaxes(2, 3).reshape(lanes, -1, size)

    def _factor(self) -> NDArray[np.bool_]:
        """H = L D L', L with ones on its diagonal; `inverse` is that of D."""
        size = self.course.unknowns
        self.factor = np.zeros_like(self.h)
        self.inverse = np.empty((self.lanes, size), self.x.dtype)
        pivots = np.empty_like(self.inverse)
        good = np.ones(self.lanes, bool)
        for j in range(size):
            scaled = self.factor[:, j, :j] * pivots[:, :j]
            column = _sum(self.h[:, j:, j], -(self.factor[:, j:, :j] * scaled[:, None]))
            good &= (column[:, 0] > 0) & (column[:, 0] < FAR)
            pivots[:, j], self.inverse[:, j] = column[:, 0], self.kind(1) / column[:, 0]
            self.factor[:, j + 1 :, j] = column[:, 1:] * self.inverse[:, j : j + 1]
        return good

    def _optimal(self, step: Raw, search: _Search) -> NDArray[np.bool_]:
        """Whether a step keeps the limits of the states, and the multipliers of the right sign meet its slope."""
        own, size = self.course, self.course.unknowns
        toward = search.side.astype(self.x.dtype)
        held = search.value * toward
        held = np.where((search.side != 0) & (held > 0), held * toward, self.kind(0))
        lower = np.tril(self.h)
        whole = lower + np.tril(self.h, -1).swapaxes(1, 2)
        terms = [whole * step[:, None], self.rows[:, size:].swapaxes(1, 2) * held[:, None, size:]]
        error = _sum(self.g + held[:, :size], np.concatenate(terms, axis=2)) * search.weight[:size]
        most = self.kind(own.trusted) * np.diagonal(lower, axis1=1, axis2=2)
        met = np.all((error < most) & (error > -most), axis=1)
        y = _sum(np.zeros_like(held[:, size:]), self.rows[:, size:] * step[:, None])
        beyond = np.stack([y - search.high[:, size:], search.low[:, size:] - y]) * search.weight[size:]
        kept = np.all(beyond < self.kind(own.trusted), axis=(0, 2))
        good: NDArray[np.bool_] = met & kept
        return good

    def _advance(self, step: Raw, solved: NDArray[np.bool_]) -> None:
        """Take the step in moves and states."""
        own, (lanes, length, m) = self.course, self.u.shape
        v = step.reshape(lanes, length, m)
        largest = np.fmax(np.max(np.fmax(np.abs(v) * own.weight[:m], self.kind(0)), axis=(1, 2)), self.kind(0))
        self.largest = np.where(solved, largest, self.kind(FAR))
        x, u, s = self.x.copy(), self.u + v, np.zeros_like(self.x[:, 0])
        low, high = own.low[:m], own.high[:m]
        u = np.where(u >= low, np.where(u > high, high, u), low)
        for k in range(length):
            terms = [self.a[:, k] * s[:, None], self.b[:, k] * v[:, k, None]]
            s = _sum(self.d[:, k], np.concatenate(terms, axis=2))
            x[:, k + 1] = self.x[:, k + 1] + s
        self.x = np.where(solved[:, None, None], x, self.x)
        self.u = np.where(solved[:, None, None], u, self.u)

    def results(self) -> Raw:
        """Return outputs, whether there is a plan, the largest change, and the plan, moved up by one sample."""
        solved = self.status == SOLVED
        states = np.concatenate([self.x[:, 2:], self.x[:, -1:]], axis=1).reshape(self.lanes, -1)
        moves = np.concatenate([self.u[:, 1:], self.u[:, -1:]], axis=1).reshape(self.lanes, -1)
        plan = np.where(solved[:, None], np.concatenate([states, moves], axis=1), self.kind(0))
        output = np.where(solved[:, None], self.u[:, 0], self.fallback)
        flag = solved.astype(self.x.dtype)[:, None]
        return np.concatenate([output, flag, self.largest[:, None], plan], axis=1)


def _sum(first: Raw, terms: Raw) -> Raw:
    """Return first (..., ) + terms (..., n), added one after the other, as C does."""
    if first.size < MANY:
        whole: Raw = np.add.accumulate(np.concatenate([first[..., None], terms], axis=-1), axis=-1)[..., -1]
        return whole
    whole = first
    for j in range(terms.shape[-1]):
        whole = whole + terms[..., j]
    return whole


def _product(matrix: Raw, v: Raw) -> Raw:
    """Return matrix v for every lane of v (lanes, n), added up in order."""
    terms = matrix * v[:, None]
    return _sum(terms[..., 0], terms[..., 1:])


def _turned(matrix: Raw, w: Raw) -> Raw:
    """Return matrix w for every lane of matrix (lanes, r, n) and every row of w (lanes, rows, n), in order."""
    terms = matrix[:, None] * w[:, :, None]
    return _sum(terms[..., 0], terms[..., 1:])


class _Search:
    """The quadratic program of one iteration in the rows of its limits: `value` is y, or m of an active row."""

    def __init__(self, of: _Iteration) -> None:
        own, lanes = of.course, of.lanes
        self.own, self.kind = own, of.kind
        size, rows, m = own.unknowns, own.rows, len(own.r)
        self.first = np.concatenate([np.arange(size), np.zeros(rows - size, np.int64)])
        limited = own.length * [own.weight[m:]]
        self.weight = np.concatenate([np.tile(own.weight[:m], own.length), *limited])
        plan = np.concatenate([of.u.reshape(lanes, -1), of.e[:, 1:, own.limited].reshape(lanes, -1)], axis=1)
        ends = [
            np.concatenate([np.tile(end[:m], own.length), np.tile(end[m:], own.length)]) for end in (own.low, own.high)
        ]
        self.low, self.high = ends[0] - plan, ends[1] - plan
        self.v = np.zeros_like(of.rows)  # L^-1 G'
        right = -of.g
        for j in range(size):
            kept = np.arange(j) >= self.first[:, None]  # before, there is nothing yet
            taken = np.where(kept, -(of.factor[:, j, None, :j] * self.v[:, :, :j]), self.kind(0))
            self.v[:, :, j] = _sum(of.rows[:, :, j], taken)
            right[:, j] = _sum(right[:, j], -(of.factor[:, j, :j] * right[:, :j]))
        self.inverse = of.inverse
        kept = np.arange(size) >= self.first[:, None]
        terms = np.where(kept, self.v * (right * of.inverse)[:, None], self.kind(0))
        self.value = _sum(np.zeros((lanes, rows), of.x.dtype), terms)
        self.free = self.value[:, :size].copy()
        self.side = np.zeros((lanes, rows), np.int64)

    def run(self, factored: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Let violated rows enter until none is left; return the status (lanes,)."""
        status = np.zeros(len(self.value), np.int64)
        entering, excess = self._select(np.arange(len(status)))
        lanes = np.flatnonzero(factored & (excess > self.own.tolerance))
        if not len(lanes):
            return status
        self._tableau(lanes)
        row, work = entering[lanes], np.zeros(len(lanes), np.int64)
        place = np.arange(len(lanes))  # of a lane in the tableau
        limit, toward, multiplier = self._entered(lanes, row)
        while len(lanes):
            column = self.t[place, :, row]
            pivot, value = column[np.arange(len(row)), row], self.value[lanes]
            step = (value[np.arange(len(row)), row] - limit) * toward / pivot
            step = np.where(pivot > self.least[place, row], step, self.kind(FAR))
            held = self.side[lanes].astype(value.dtype)
            rate = column * (toward[:, None] * held)
            ratio = np.where((held != 0) & (rate > 0), value * held / rate, self.kind(FAR))
            ratio = np.where(ratio < self.kind(FAR), ratio, self.kind(FAR))
            leaving = ratio.argmin(axis=1)
            nearest = ratio[np.arange(len(row)), leaving]
            leaves = nearest < step
            step = np.where(leaves, nearest, step)
            going = step < FAR
            status[lanes[~going]] = INFEASIBLE
            moved = step * toward
            multiplier = multiplier + moved
            self.value[lanes[going]] = (value - column * moved[:, None])[going]
            turned = np.where(leaves, leaving, row)
            above = self.side[lanes, turned] > 0
            ends = np.where(above, self.high[lanes, turned], self.low[lanes, turned])
            self.value[lanes, turned] = np.where(leaves, ends, multiplier)
            self.side[lanes, turned] = np.where(leaves, 0, toward.astype(np.int64))
            self._pivot(place[going], turned[going])
            work = work + 1
            selected, excess = self._select(lanes)
            done = ~leaves & ~(excess > self.own.tolerance)
            capped = going & ~done & (work >= self.own.budget)
            status[lanes[capped]] = CAPPED
            next_row = np.where(leaves, row, selected)
            fresh = self._entered(lanes, next_row)
            limit, toward, multiplier = (
                np.where(leaves, old, new) for old, new in zip((limit, toward, multiplier), fresh, strict=True)
            )
            stays = going & ~done & ~capped
            lanes, place, row, work = lanes[stays], place[stays], next_row[stays], work[stays]
            limit, toward, multiplier = limit[stays], toward[stays], multiplier[stays]
        return status

    def _entered(self, lanes: NDArray[np.int64], row: NDArray[np.int64]) -> tuple[Raw, Raw, Raw]:
        """Return the limit that a row violates, the side it is on, and its multiplier, zero."""
        above = self.value[lanes, row] > self.high[lanes, row]
        limit = np.where(above, self.high[lanes, row], self.low[lanes, row])
        return limit, np.where(above, self.kind(1), self.kind(-1)), np.zeros(len(lanes), self.value.dtype)

    def _select(self, lanes: NDArray[np.int64]) -> tuple[NDArray[np.int64], Raw]:
        """Find the most violated row outside the active set and its excess, in its span."""
        value, low, high = self.value[lanes], self.low[lanes], self.high[lanes]
        over, under = value - high, low - value
        excess = np.where(over > under, over, under) * self.weight
        excess = np.where(self.side[lanes] == 0, np.fmax(excess, self.kind(-1)), self.kind(-1))
        row = excess.argmax(axis=1)
        return row, excess[np.arange(len(lanes)), row]

    def _tableau(self, lanes: NDArray[np.int64]) -> None:
        """T = V D^-1 V', below the diagonal and mirrored."""
        v = self.v[lanes]
        scaled = v * self.inverse[lanes][:, None]
        t = np.zeros((len(lanes), v.shape[1], v.shape[1]), v.dtype)
        for j in range(v.shape[2]):
            kept = self.first <= j
            product = v[:, :, None, j] * scaled[:, None, :, j]
            t = t + np.where(kept[:, None] & kept, product, self.kind(0))
        self.t = np.tril(t) + np.tril(t, -1).swapaxes(1, 2)
        self.least = self.kind(self.own.least) * np.diagonal(self.t, axis1=1, axis2=2)

    def _pivot(self, place: NDArray[np.int64], row: NDArray[np.int64]) -> None:
        """Exchange the multiplier and the value of a row."""
        which = np.arange(len(place))
        t = self.t[place]
        inverse = self.kind(1) / t[which, row, row]
        across, column = t[which, row] * inverse[:, None], t[which, :, row]
        t = t - column[:, :, None] * across[:, None]
        t[which, row] = across
        t[which, :, row] = -(column * inverse[:, None])
        t[which, row, row] = inverse
        self.t[place] = t

    def moves(self) -> Raw:
        """Return the step of every move; an active one ends at its limit."""
        size = self.own.unknowns
        ends = np.where(self.side > 0, self.high, self.low)
        return np.where(self.side != 0, ends, self.value)[:, :size]
