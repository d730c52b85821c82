"""Find how many sweeps of Douglas and Rachford lead near the optimum of a quadratic program, and with which weights.

The optimum is where two monotone operators add up to zero: the rows y of the program, and the limits that they keep.
With the gram's rows weighed, G, and d = slope p, the resolvent of the one is y = M r + (1 - M) d with M = (1 + G)^-1 G,
that of the other limits to low and high; a sweep reflects at the one after the other (Lions and Mercier, SIAM J.
Numerical Analysis 16, 1979), STEP of the way. No sweep takes two starts farther apart than they were, whatever the
problem: so nothing that one sweep rounds can grow in the next ones. The start is the unconstrained optimum, which is
the answer where it keeps every limit.

The weights decide how fast it goes; nothing but trying tells which do.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from firmloop.design.law import DesignError, Law, Quadratic, Sweeps
from firmloop.design.optimum import QuadraticSolver, Solution
from firmloop.design.outcome import CAPPED, SOLVED
from firmloop.design.quadratic.region import drawn_parameters

Array = npt.NDArray[np.float64]

STEP = 1.75  # of a sweep: 2 would be the whole reflection, which can circle for ever
WEIGHTS = (10.0, 30.0, 3.0, 100.0, 1.0)  # of the moves' rows, squared; likely ones first
RATIOS = (1.0, 3.0, 0.3, 10.0, 0.1)  # of the other rows' weights to those, squared
MOST = 400  # sweeps
BEST = 3  # of the weights, which are tried in the rounds after the first
JUDGED = 700  # parameters drawn evenly, and as many toward the middle, in each round
HARDEST = 40  # of them, to choose by: those with most active rows, and in each round those that were missed most
ROUNDS = 12
SPARE = 0.7  # share of the accuracy that the sweeps must reach where they are chosen
IN_A_ROW = 3  # sweeps after which it must be kept, for an error may pass through zero
ROOM = 2.0  # how much farther than any start that was drawn the sweeps may go; how much farther it may miss a limit
LEAST_MISS = 1e-3  # of a move's range: a limit missed by less is kept
HALVINGS = 8  # of how far the sweeps may go, while that costs no sweep


@dataclass(frozen=True, slots=True)
class JudgedSweeps:
    """What was seen from `count` drawn parameters that have an optimum."""

    worst: float  # error of an output, over its range
    capped: float  # share of them that were called so
    count: int


def choose_sweeps(law: Law, accuracy: float, optimum: QuadraticSolver) -> tuple[Sweeps, JudgedSweeps]:
    """Return the fewest sweeps whose outputs are within `accuracy`, a share of their ranges, of the optimum.

    Raises
    ------
    DesignError
        when MOST sweeps do not suffice with any weights, with the error that they leave.
    """
    assert law.solve is not None
    problem, least = law.solve.quadratic, np.inf
    pool = _starts(problem, drawn_parameters(law, JUDGED, 0), optimum)
    chosen = pool.part(np.argsort(-pool.active, kind="stable")[:HARDEST])
    ratios = RATIOS if problem.moves < len(problem.low) else RATIOS[:1]
    weighed = [_weighed(problem, *pair) for pair in itertools.product(WEIGHTS, ratios)]
    for seed in range(1, ROUNDS + 1):
        weighed, found, least = _fewest(weighed, chosen, SPARE * accuracy)
        if found is None and least <= accuracy:
            weighed, found, least = _fewest(weighed, chosen, accuracy)
        if found is None:
            break
        fresh = _starts(problem, drawn_parameters(law, JUDGED, seed), optimum)
        errors = fresh.errors(swept(found, fresh.parameters).moves)
        least = float(np.max(errors, initial=0.0))
        if least <= accuracy:
            sweeps = replace(found, tolerance=_tolerance(found, pool))
            capped = swept(sweeps, fresh.parameters).status == CAPPED
            return sweeps, JudgedSweeps(least, float(np.mean(capped)) if len(capped) else 0.0, len(capped))
        chosen = chosen.with_parts(fresh.part(np.argsort(-errors, kind="stable")[:HARDEST]))
    raise DesignError(
        f"controller.solver = 'fixed_iterations': {MOST} iterations leave an error of {least:.3g} of the output's "
        f"range, controller.accuracy allows {accuracy:g}; allow more, hold moves longer (blocks), leave out limits of "
        'states or of changes, narrow the ranges in [signals], or use solver = "online"'
    )


def swept(sweeps: Sweeps, parameters: Array) -> Solution:
    """Run the sweeps for every row of `parameters` (lanes, p)."""
    s, y, c = _states(sweeps, parameters)
    for k in range(sweeps.times):
        s, y, c = _next(sweeps, s, parameters @ sweeps.push.T, k < sweeps.times - 1)
    drives = len(sweeps.scale)
    moves = np.clip(y, sweeps.low, sweeps.high)[:, :drives] * sweeps.scale
    near = np.max(np.abs(y - c), axis=1) <= sweeps.tolerance
    side = (c == sweeps.high).astype(np.int64) - (c == sweeps.low)
    work = np.full(len(s), sweeps.times)
    return Solution(moves, np.where(near, SOLVED, CAPPED).astype(np.int64), work, side)


def _states(sweeps: Sweeps, parameters: Array) -> tuple[Array, Array, Array]:
    s = parameters @ sweeps.slope.T
    return s, s, np.clip(s, sweeps.low, sweeps.high)


def _next(sweeps: Sweeps, s: Array, push: Array, goes_on: bool) -> tuple[Array, Array, Array]:
    """Return s after a sweep, and the y and c of it."""
    s = np.clip(s, -sweeps.reach, sweeps.reach)
    c = np.clip(s, sweeps.low, sweeps.high)
    y = (2 * c - s) @ sweeps.mix + push
    return (s + STEP * (y - c) if goes_on else s), y, c


@dataclass(frozen=True, slots=True)
class _Starts:
    """Parameters that have an optimum, its moves (lanes, k) and how many of its rows are active (lanes,)."""

    parameters: Array
    moves: Array
    active: Array
    range: Array  # (k,)

    def part(self, lanes: npt.NDArray[np.int64]) -> _Starts:
        return _Starts(self.parameters[lanes], self.moves[lanes], self.active[lanes], self.range)

    def with_parts(self, other: _Starts) -> _Starts:
        return _Starts(
            np.concatenate([self.parameters, other.parameters]),
            np.concatenate([self.moves, other.moves]),
            np.concatenate([self.active, other.active]),
            self.range,
        )

    def errors(self, moves: Array) -> Array:
        """Return the largest error of a move over its range (lanes,)."""
        found: Array = np.max(np.abs(moves - self.moves) / self.range, axis=1)
        return found


def _starts(problem: Quadratic, parameters: Array, optimum: QuadraticSolver) -> _Starts:
    found = optimum(problem, parameters)
    low, high = (ends[: len(problem.scale)] * problem.scale for ends in (problem.low, problem.high))
    good = found.status == SOLVED
    active = np.count_nonzero(found.side[good], axis=1)
    return _Starts(parameters[good], np.clip(found.moves[good], low, high), active, high - low)


def _fewest(weighed: list[Sweeps], starts: _Starts, accuracy: float) -> tuple[list[Sweeps], Sweeps | None, float]:
    """Return the BEST of the weights, that which needs the fewest sweeps, and the least error seen with any."""
    tried = [_needed(found, starts, MOST, accuracy) for found in weighed]
    order = np.argsort([needed for needed, _ in tried], kind="stable")[:BEST]
    times, least = tried[order[0]][0], min(left for _, left in tried)
    found = _bounded(weighed[order[0]], times, starts, accuracy) if times <= MOST else None
    return [weighed[k] for k in order], found, least


def _weighed(problem: Quadratic, weight: float, ratio: float) -> Sweeps:
    size = len(problem.low)
    factors = np.sqrt(np.where(np.arange(size) < problem.moves, weight, weight * ratio))
    gram = problem.gram * np.outer(factors, factors)
    mix = np.linalg.solve(np.eye(size) + gram, gram)
    mix = (mix + mix.T) / 2
    slope = problem.slope * factors[:, None]
    scale = problem.scale / factors[: len(problem.scale)]
    return Sweeps(
        slope, slope - mix @ slope, mix, problem.low * factors, problem.high * factors, scale, np.inf, np.inf, 0
    )


def _needed(sweeps: Sweeps, starts: _Starts, most: int, accuracy: float) -> tuple[int, float]:
    """Return after how many sweeps, `most` at most, every output is within `accuracy`; and the least error seen."""
    s, _, _ = _states(sweeps, starts.parameters)
    push, drives = starts.parameters @ sweeps.push.T, len(sweeps.scale)
    kept, least = 0, np.inf
    for k in range(most + IN_A_ROW - 1):
        s, y, _ = _next(sweeps, s, push, True)
        moves = np.clip(y[:, :drives], sweeps.low[:drives], sweeps.high[:drives]) * sweeps.scale
        error = float(np.max(starts.errors(moves), initial=0.0))
        least, kept = min(least, error), kept + 1 if error <= accuracy else 0
        if kept == IN_A_ROW:
            return k + 2 - IN_A_ROW, least
    return MOST + 1, least


def _bounded(sweeps: Sweeps, times: int, starts: _Starts, accuracy: float) -> Sweeps:
    """Limit how far the sweeps may go: by how far they went, and less while that costs no sweep."""
    s, _, _ = _states(sweeps, starts.parameters)
    push, farthest = starts.parameters @ sweeps.push.T, float(np.max(np.abs(s), initial=0.0))
    for _ in range(times):
        s, _, _ = _next(sweeps, s, push, True)
        farthest = max(farthest, float(np.max(np.abs(s), initial=0.0)))
    limits = np.abs(np.concatenate([sweeps.low, sweeps.high]))
    widest = float(np.max(limits[np.isfinite(limits)]))
    found = replace(sweeps, times=times, reach=ROOM * max(farthest, widest))
    for _ in range(HALVINGS):
        nearer = replace(found, reach=found.reach / 2)
        if (
            nearer.reach < ROOM * widest
            or _needed(replace(nearer, reach=nearer.reach / ROOM), starts, times, accuracy)[0] > times
        ):
            break
        found = nearer
    return found


def _tolerance(sweeps: Sweeps, starts: _Starts) -> float:
    """Return by how much a row may miss its limits at the end: somewhat more than from any start that was drawn."""
    s, _, _ = _states(sweeps, starts.parameters)
    push, missed = starts.parameters @ sweeps.push.T, 0.0
    for k in range(sweeps.times):
        s, y, c = _next(sweeps, s, push, k < sweeps.times - 1)
        missed = float(np.max(np.abs(y - c), initial=0.0))
    return ROOM * max(missed, LEAST_MISS * float(np.min((sweeps.high - sweeps.low)[: len(sweeps.scale)])))
