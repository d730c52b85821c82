"""One real-time iteration of nonlinear predictive control, for many lanes at once: the twin of fl_rti.h, bit for bit.

    min 1/2 sum (x - t)'Q(x - t) + (u - r)'R(u - r) + d'S d,   d[k] = u[k] - u[k-1],   P instead of Q at the end
    x[k+1] = step(x[k], u[k]),   low <= u <= high,   x_low <= x <= x_high for some states

The unknowns are the moves u[0..N-1] and the states x[1..N] between them (multiple shooting: Bock and Plitt, IFAC World
Congress 1984). Each sample takes one Gauss-Newton step of sequential quadratic programming from the plan of the sample
before, moved up by one (real-time iteration: Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005); where there
is none, from the states that the moves lead to. The steps of the states are eliminated column by column, the rest is

    min 1/2 v'Hv + g'v,   low <= G v <= high,   H = L D L'

and solved by the dual active-set method of `rti_search.py`. What is found counts only where it meets the optimality
conditions of the problem's own H, g and G.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.twins.rti_course import CAPPED, FAR, SOLVED, Raw, RtiCourse, add_up
from firmloop.quantize.twins.rti_search import RtiSearch

Model = Callable[[Sequence[Raw]], Sequence[Raw]]  # x and u -> x of the next sample, then its slopes row by row

CHUNK = 256  # lanes at a time: their tableaus stay within the processor's cache


def improve(course: RtiCourse, model: Model, parameters: Raw) -> tuple[Raw, NDArray[np.int64]]:
    """Return the results (lanes, k) and the status (lanes,) for `parameters` (lanes, p).

    Parameters are x[0], t, the last output and, unless every sample starts without a plan, 1 where there is one, and
    x[1..N] and u[0..N-1] of it. Results are the outputs, 1 where there is a plan for the next sample, the largest
    change of a move in its span, and that plan.
    """
    if not len(parameters):
        width = len(course.r) + 2 + course.length * (len(course.q) + len(course.r))
        return np.empty((0, width), parameters.dtype), np.empty(0, np.int64)
    parts = [_chunk(course, model, parameters[at : at + CHUNK]) for at in range(0, len(parameters), CHUNK)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _chunk(course: RtiCourse, model: Model, parameters: Raw) -> tuple[Raw, NDArray[np.int64]]:
    n, m, length = len(course.q), len(course.r), course.length
    edges = np.cumsum([n, n, m, 1, length * n])
    parameters = np.pad(parameters, ((0, 0), (0, edges[-1] + length * m - parameters.shape[1])))
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

    def __init__(self, course: RtiCourse, model: Model, target: Raw, last: Raw, x: Raw, u: Raw) -> None:
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
        limited = self.e[:, 1:, self.course.limited].reshape(self.lanes, -1)
        plan = np.concatenate([self.u.reshape(self.lanes, -1), limited], axis=1)
        search = RtiSearch(self.course, self.rows, plan, self.g, self.factor, self.inverse)
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
            s = add_up(self.d[:, k], self.a[:, k] * s[:, None])
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
            g[:, k] = add_up(row, self.b[:, k].swapaxes(1, 2) * slope[:, None])
            here = _product(own.q, self.e[:, k] - self.target)
            slope = add_up(here, self.a[:, k].swapaxes(1, 2) * slope[:, None])
        for k in range(length):
            before = self.u[:, k - 1] if k else self.last
            g[:, k] = g[:, k] + own.change * (self.u[:, k] - before)
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
                slope = add_up(back, self.a[:, k, None].swapaxes(2, 3) * slope[:, :done, None])
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
            column = add_up(self.h[:, j:, j], -(self.factor[:, j:, :j] * scaled[:, None]))
            good &= (column[:, 0] > 0) & (column[:, 0] < FAR)
            pivots[:, j], self.inverse[:, j] = column[:, 0], self.kind(1) / column[:, 0]
            self.factor[:, j + 1 :, j] = column[:, 1:] * self.inverse[:, j : j + 1]
        return good

    def _optimal(self, step: Raw, search: RtiSearch) -> NDArray[np.bool_]:
        """Whether a step keeps the limits of the states, and the multipliers of the right sign meet its slope."""
        own, size = self.course, self.course.unknowns
        toward = search.side.astype(self.x.dtype)
        held = search.value * toward
        held = np.where((search.side != 0) & (held > 0), held * toward, self.kind(0))
        lower = np.tril(self.h)
        whole = lower + np.tril(self.h, -1).swapaxes(1, 2)
        terms = [whole * step[:, None], self.rows[:, size:].swapaxes(1, 2) * held[:, None, size:]]
        error = add_up(self.g + held[:, :size], np.concatenate(terms, axis=2)) * search.weight[:size]
        most = self.kind(own.trusted) * np.diagonal(lower, axis1=1, axis2=2)
        met = np.all((error < most) & (error > -most), axis=1)
        y = add_up(np.zeros_like(held[:, size:]), self.rows[:, size:] * step[:, None])
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
            s = add_up(self.d[:, k], np.concatenate(terms, axis=2))
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


def _product(matrix: Raw, v: Raw) -> Raw:
    """Return matrix v for every lane of v (lanes, n), added up in order."""
    terms = matrix * v[:, None]
    return add_up(terms[..., 0], terms[..., 1:])


def _turned(matrix: Raw, w: Raw) -> Raw:
    """Return matrix w for every lane of matrix (lanes, r, n) and every row of w (lanes, rows, n), in order."""
    terms = matrix[:, None] * w[:, :, None]
    return add_up(terms[..., 0], terms[..., 1:])
