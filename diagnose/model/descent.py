"""Descend in a sum of whitened squares: damped steps, each brought back into its valley before it is judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.bounded_step import solved_within
from firmloop.diagnose.model.hypothesis import Point, Problem, Unknown, stepped, waves
from firmloop.diagnose.model.slopes import residual_of, slopes_across, slopes_of, start_slopes, whitened
from firmloop.diagnose.policy import (
    BROKEN_DAMPING,
    CORRECTED_SHARE,
    CORRECTIONS,
    DAMPINGS,
    DIVERGED_RESIDUAL,
    EXACT_STEPS,
    FEW_DAMPINGS,
    FIRST_DAMPING,
    FIT_PATIENCE,
    HELD_DAMPING,
    KEPT_DAMPING,
    KEPT_PROMISE,
    LEAST_DAMPING,
    LEAST_DECREASE,
    LEAST_RELATIVE_DECREASE,
    LITTLE_DAMPING,
    LONGER,
    LONGEST_STEP,
    REFUSED_DAMPING,
    UNDAMPED,
)
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Place:
    """A point with what it leaves: `cost` counts the whitened residuals (n, r) of each recording, `pull` the tether.

    `took` are the steps of each simulation, in millions.
    """

    point: Point
    cost: float
    pull: float
    residuals: tuple[Array, ...]
    took: tuple[float, ...]

    @property
    def whole(self) -> float:
        """What a descent lowers."""
        return self.cost + self.pull

    @property
    def least(self) -> float:
        """The least decrease that is worth a step."""
        return max(LEAST_DECREASE, LEAST_RELATIVE_DECREASE * self.cost)

    @property
    def finite(self) -> bool:
        """Whether no simulation has diverged."""
        return not any(np.any(np.isnan(part)) for part in self.residuals)


@dataclass(frozen=True, slots=True)
class SumOfSquares:
    """What is fitted to what: coordinates (k,) and an initial state (s,) of every recording.

    `tether` holds rows [weights over the coordinates, aim] of what is known beforehand, in standard deviations.
    """

    problem: Problem
    recordings: Sequence[Recording]
    unknowns: Sequence[Unknown]
    noises: Sequence[Noise]
    tether: Array

    def at(self, point: Point, near: Place | None = None) -> Place:
        """Simulate every recording at a point; far longer simulations than those at a place `near` it have diverged."""
        residuals, took, cost = [], [], 0.0
        for k, each in enumerate(self.recordings):
            before = self.problem.engine.steps
            most = math.inf if near is None else LONGER * near.took[k]
            residuals.append(residual_of(self.problem, each, point, k, most))
            took.append(self.problem.engine.steps - before)
        for part in residuals:
            if np.any(np.isnan(part)):
                cost += DIVERGED_RESIDUAL**2 * part.size
            else:
                cost += float(np.sum(whitened(part, self.noises) ** 2))
        return Place(point, cost, self.pull(point), tuple(residuals), tuple(took))

    def pull(self, point: Point) -> float:
        """Return how far a point is from what is known beforehand, squared."""
        return float(np.sum(self._tied(point) ** 2))

    def moved(self, point: Point, step: Array) -> Point:
        """Return the point a step (k + s w,) of all unknowns away; bounds hold by stopping at them."""
        count, states = len(self.unknowns), len(self.problem.engine.states)
        values = dict(point.values)
        there = stepped(self.problem.terms, self.unknowns, self._inner(point), step[:count])
        for each, place in zip(self.unknowns, there, strict=True):
            values[each.name] = each.outer(float(place))
        for term in self.problem.terms:
            if term.effect.within is not None and all(key in values for key in term.keys):
                own = term.effect.within([values[key] for key in term.keys], term.scales)
                values.update(zip(term.keys, own, strict=True))
        return Point(
            values,
            tuple(start + step[count + states * k : count + states * (k + 1)] for k, start in enumerate(point.starts)),
        )

    def slopes(self, place: Place, own: Sequence[Array] | None = None) -> tuple[Array, ...]:
        """Return the whitened slopes (q, k + s) of every recording; none of one that has diverged."""
        found = []
        for k, (recording, residual) in enumerate(zip(self.recordings, place.residuals, strict=True)):
            if np.any(np.isnan(residual)):
                found.append(np.zeros((0, len(self.unknowns) + len(self.problem.engine.states))))
            else:
                known = None if own is None else own[k]
                tall = slopes_of(self.problem, recording, self.unknowns, place.point, k, residual, known)
                found.append(whitened(tall, self.noises))
        return tuple(found)

    def slopes_across(self, place: Place) -> tuple[Array, ...]:
        """Return whitened slopes as the mean of those on either side of a kink, see there."""
        if not place.finite:
            return self.slopes(place)
        own = self.start_slopes(place.point, exact=True)
        pairs = zip(self.recordings, own, strict=True)
        tall = (slopes_across(self.problem, one, self.unknowns, place.point, k, s) for k, (one, s) in enumerate(pairs))
        return tuple(whitened(each, self.noises) for each in tall)

    def start_slopes(self, point: Point, exact: bool = False) -> list[Array]:
        """Return d output / d initial state (n, r, s) of every recording, as `start_slopes` does."""
        return [start_slopes(self.problem, each, point, k, exact) for k, each in enumerate(self.recordings)]

    def restarted(self, slopes: Sequence[Array], place: Place) -> tuple[Array, ...]:
        """Return whitened slopes with those for initial states as they are at a place."""
        count, found = len(self.unknowns), []
        for flat, own in zip(slopes, self.start_slopes(place.point, exact=True), strict=True):
            flat = flat.copy()
            flat[:, count:] = whitened(np.nan_to_num(own), self.noises)[: len(flat)]
            found.append(flat)
        return tuple(found)

    def step(self, normal: Array, pulled: Array, damping: float, point: Point) -> tuple[Array, float]:
        """Return a damped step (k + s w,) from a point, and how much it would lower the cost if all were linear.

        `normal` and `pulled` are what `normal` and `descent` return. A coordinate that would leave its bounds goes to
        them, and the others as is best for them then. The step is no longer than it may be, the promise that of a step
        of any length.
        """
        count, step = len(self.unknowns), solved_within(normal, pulled, damping, *self._room(point))
        promise = float(2.0 * pulled @ step - step @ normal @ step)
        step[:count] = np.clip(step[:count], -LONGEST_STEP, LONGEST_STEP)
        return step, promise

    def _room(self, point: Point) -> tuple[Array, Array]:
        """Return how far each coordinate (k,) may go down and up; of what goes by its quadratures, any way."""
        here, free = self._inner(point), {key for keys in waves(self.problem.terms) for key in keys}
        low = [-math.inf if each.name in free else each.inner(each.low) for each in self.unknowns]
        high = [math.inf if each.name in free else each.inner(each.high) for each in self.unknowns]
        return np.minimum(np.array(low) - here, 0.0), np.maximum(np.array(high) - here, 0.0)

    def normal(self, slopes: Sequence[Array]) -> Array:
        """Return J'J (k + s w, same), the tether's with it."""
        count, weights = len(self.unknowns), self.tether[:, :-1]
        size = count + len(self.problem.engine.states) * len(slopes)
        total = np.zeros((size, size))
        for k, flat in enumerate(slopes):
            total[np.ix_(self._places(k), self._places(k))] += flat.T @ flat
        total[:count, :count] += weights.T @ weights
        return total

    def descent(self, slopes: Sequence[Array], place: Place) -> Array:
        """Return -J'r (k + s w,): where the cost falls from a place, with slopes taken there or near it."""
        count = len(self.unknowns)
        total = np.zeros(count + len(self.problem.engine.states) * len(slopes))
        for k, flat in enumerate(slopes):
            if len(flat):
                total[self._places(k)] += flat.T @ whitened(place.residuals[k], self.noises)
        total[:count] -= self.tether[:, :-1].T @ self._tied(place.point)
        return total

    def spread_out(self, k: int, own: Array) -> Array:
        """Return rows (k + s, ...) of the coordinates and one recording's initial state at their places in all."""
        total = np.zeros((len(self.unknowns) + len(self.problem.engine.states) * len(self.recordings), *own.shape[1:]))
        total[self._places(k)] = own
        return total

    def amended(self, slopes: Sequence[Array], before: Place, place: Place) -> tuple[Array, ...]:
        """Return slopes taken near `before` that tell how the residuals have changed from there to a place."""
        found = []
        moved = self._inner(place.point) - self._inner(before.point)
        for k, flat in enumerate(slopes):
            step = np.concatenate([moved, place.point.starts[k] - before.point.starts[k]])
            told = np.sum(flat**2, axis=0) * step
            size = float(told @ step)
            if len(flat) and size > 0.0:
                change = whitened(before.residuals[k] - place.residuals[k], self.noises)
                flat = flat + np.outer(change - flat @ step, told / size)
            found.append(flat)
        return tuple(found)

    def _places(self, k: int) -> NDArray[np.intp]:
        count, states = len(self.unknowns), len(self.problem.engine.states)
        return np.concatenate([np.arange(count), count + states * k + np.arange(states)])

    def _inner(self, point: Point) -> Array:
        neutral = self.problem.engine.neutral
        return np.array([each.inner(point.values.get(each.name, neutral[each.name])) for each in self.unknowns])

    def _tied(self, point: Point) -> Array:
        return np.asarray(self.tether[:, :-1] @ self._inner(point) - self.tether[:, -1])


def descended(squares: SumOfSquares, begin: Point, steps: int, patience: float = FIT_PATIENCE) -> tuple[Place, Array]:
    """Search from `begin` as Levenberg (1944) and Marquardt (1963); return the place and J'J of the slopes taken last.

    Where some combinations of coordinates are known far better than others, a long step along what is hardly known
    leaves a curved valley. Before such a step is damped it is corrected with the slopes it was made with, as chords in
    Newton's method (Shamanskii 1967), as long as that leads back. Damping holds just these combinations back, so that
    a descent is not at its end while it is damped. No step begins after `patience` (million steps of simulation).
    """
    place = squares.at(begin)
    until = squares.problem.engine.steps + patience
    own: list[Array] | None = squares.start_slopes(begin)  # for a few steps
    damping, tries = FIRST_DAMPING, DAMPINGS
    normal: Array | None = None
    begun: tuple[Array, ...] | None = None
    rough = steps >= EXACT_STEPS and squares.problem.engine.engine.equations is None  # see start_slopes
    for _ in range(steps):
        if squares.problem.engine.steps > until:
            break
        slopes = begun or squares.slopes(place, own or squares.start_slopes(place.point, exact=True))
        normal, begun, lower = squares.normal(slopes), None, None
        pulled, least = squares.descent(slopes, place), place.least
        while damping > UNDAMPED and squares.step(normal, pulled, damping, place.point)[1] < least:
            damping /= LITTLE_DAMPING
        for _ in range(tries):
            step, promise = squares.step(normal, pulled, damping, place.point)
            if promise < least:
                break  # what is not worth a step is not worth its simulation
            lower = _lower(squares, place, slopes, normal, damping, step)
            if lower is not None:
                break
            damping = max(damping * REFUSED_DAMPING, 1e-6)
        gain = 0.0 if lower is None else place.whole - lower.whole
        little, before, place = gain < least, place, lower or place
        if own and rough and (little or damping > HELD_DAMPING):
            own, damping, tries = None, FIRST_DAMPING, DAMPINGS
            begun = squares.restarted(slopes, place)
            continue
        if lower is None or (little and damping < UNDAMPED):
            break
        # Less where a step has kept its promise, more where it has not.
        kept = min(max(1.0 / KEPT_DAMPING, 1.0 - (2.0 * gain / promise - 1.0) ** 3), BROKEN_DAMPING)
        damping, tries = (damping / LITTLE_DAMPING, FEW_DAMPINGS) if little else (damping * kept, DAMPINGS)
        damping = max(damping, LEAST_DAMPING)
        if not little:
            place, damping = _onward(squares, before, place, slopes, damping, least)
    return place, squares.normal(squares.slopes(place, own)) if normal is None else normal


def past_kink(squares: SumOfSquares, place: Place) -> Place | None:
    """Return a place that costs less than where a descent has ended, by slopes across a kink there; None if none does.

    Where a shaft just comes to rest, or just does not, a valley may have a sharp floor, along which no one-sided slope
    leads, and those of several coordinates need not be of one side.
    """
    slopes, damping = squares.slopes_across(place), FIRST_DAMPING
    normal, pulled = squares.normal(slopes), squares.descent(slopes, place)
    for _ in range(DAMPINGS):
        step, promise = squares.step(normal, pulled, damping, place.point)
        if promise < place.least:
            break
        lower = _lower(squares, place, slopes, normal, damping, step)
        if lower is not None and place.whole - lower.whole > place.least:
            return lower
        damping *= REFUSED_DAMPING
    return None


def _onward(
    squares: SumOfSquares, before: Place, place: Place, slopes: Sequence[Array], damping: float, least: float
) -> tuple[Place, float]:
    """Go on from a place with the slopes of the one before, amended by what each step does, as long as they hold.

    Slopes cost a simulation for every unknown, a step one (Broyden, Math. Comp. 19 (1965) 577-593).
    """
    while True:
        slopes = squares.amended(slopes, before, place)
        step, promise = squares.step(squares.normal(slopes), squares.descent(slopes, place), damping, place.point)
        if promise < least:
            return place, damping
        trial = squares.at(squares.moved(place.point, step), place)
        gain = place.whole - trial.whole
        if gain <= 0.0:
            return place, damping
        before, place = place, trial
        if gain < max(KEPT_PROMISE * promise, least):
            return place, damping
        damping = max(damping / KEPT_DAMPING, LEAST_DAMPING)


def _lower(
    squares: SumOfSquares, place: Place, slopes: Sequence[Array], normal: Array, damping: float, step: Array
) -> Place | None:
    """Return a place that costs less, a damped step and its corrections away; None where they do not lead there."""
    trial, worse = place, np.inf
    for _ in range(CORRECTIONS + 1):
        trial = squares.at(squares.moved(trial.point, step), place)
        if trial.whole < place.whole:
            return trial
        if not trial.finite or trial.whole - place.whole > CORRECTED_SHARE * worse:
            break
        worse = trial.whole - place.whole
        step, _ = squares.step(normal, squares.descent(slopes, trial), damping, trial.point)
    return None
