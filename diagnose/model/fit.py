"""Fit a hypothesis to recordings: whitened simulation-error least squares with every initial state free."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.bounded_step import solved
from firmloop.diagnose.model.descent import Place, SumOfSquares, descended, past_kink
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, Unknown, coordinates, full_start
from firmloop.diagnose.model.torque_scale import inertia_of, near_given, on_scale_of_torques
from firmloop.diagnose.policy import (
    CONSTANT_DEVIATION,
    FIT_PATIENCE,
    GIVEN_DEVIATION,
    LAST_GAIN,
    LAST_STEPS,
    SAME_CONSTANT,
    SETTLED_START,
    STEPS_OF_A_FIT,
    UNSEEN,
)
from firmloop.identify.fitting.experiment import stretches
from firmloop.identify.fitting.noise import ORDERS, Noise, bounded, fit_noise, white
from firmloop.identify.fitting.own_values import by_itself
from firmloop.identify.fitting.problem import LEASH
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Fitted:
    """A hypothesis at its best point; residuals are measured - simulated (n, r) per recording, in the outputs' units.

    `normal` is J'J of the whitened slopes for (coordinates, initial states of each recording in turn). `wider` (k,) are
    the factors by which deviations are larger than it says; None for 1.
    """

    terms: tuple[LibraryTerm, ...]
    coordinates: tuple[Unknown, ...]
    point: Point
    residuals: tuple[Array, ...]
    cost: float  # sum of squares of the residuals whitened by `noises`
    noises: tuple[Noise, ...]
    normal: Array
    wider: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Effects by name, in the order they were found."""
        return tuple(term.effect.name for term in self.terms)


def noises_of(problem: Problem, residuals: Sequence[Array], orders: Sequence[int] = ORDERS) -> tuple[Noise, ...]:
    """Estimate every output's noise from what a fit left over; it costs what it is larger than noise may be.

    A misfit is that of a few independent samples, without memory.
    """
    columns = [[part[:, index] for part in residuals] for index in range(residuals[0].shape[1])]
    if problem.samples:
        share = problem.samples / sum(map(len, residuals))
        sized = [fit_noise(each, float(floor), (0,)).rms for each, floor in zip(columns, problem.floors, strict=True)]
        return tuple(replace(white(rms), samples=share) for rms in sized)
    sizes = zip(columns, problem.floors, problem.drifts, strict=True)
    return tuple(bounded(fit_noise(each, float(floor), orders), each, float(most)) for each, floor, most in sizes)


def fit(
    problem: Problem,
    recordings: Sequence[Recording],
    terms: Sequence[LibraryTerm],
    begin: Point,
    noises: Sequence[Noise],
    steps: int,
    patience: float = FIT_PATIENCE,
    held: Collection[str] = (),
) -> Fitted:
    """Search from `begin` in a given number of steps; what comes to a bound is held there.

    No step begins after `patience` (million steps of simulation). What is `held` stays.
    """
    unknowns = tuple(each for each in coordinates(problem, terms, begin.values) if each.name not in held)
    squares = SumOfSquares(problem, recordings, unknowns, noises, tethers(problem, unknowns))
    place, normal = descended(squares, begin, steps, patience)
    return Fitted(tuple(terms), unknowns, place.point, place.residuals, place.cost, tuple(noises), normal)


def squares_of(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> SumOfSquares:
    """Return what a fit lowers on train, whitened by `noises` and tied to what is known beforehand."""
    unknowns = fitted.coordinates
    return SumOfSquares(problem, problem.train, unknowns, noises, tethers(problem, unknowns))


def past_kinks(problem: Problem, fitted: Fitted) -> Fitted:
    """Go on with a fit that has ended on the sharp floor of a valley, as long as slopes across that lead down."""
    squares = squares_of(problem, fitted, fitted.noises)
    place, normal, until = squares.at(fitted.point), fitted.normal, problem.engine.steps + FIT_PATIENCE
    while problem.engine.steps < until and (lower := past_kink(squares, place)) is not None:
        place, normal = descended(squares, lower.point, STEPS_OF_A_FIT)
    return replace(fitted, point=place.point, residuals=place.residuals, cost=place.cost, normal=normal)


def ended(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Take a fit to its minimum by undamped steps, however little each is worth, and put `normal` there.

    A search ends where a step gains less than the noise, which for parameters that trade with each other may be a
    deviation away. Where contacts and kinks make slopes jump, one place may promise far more than others near it:
    deviations are the largest that any of them tells.
    """
    unknowns, count = fitted.coordinates, len(fitted.coordinates)
    squares = squares_of(problem, fitted, noises)
    place, normal = near_given(squares, squares.at(fitted.point)), fitted.normal
    told = [variances(normal, count)]
    for _ in range(LAST_STEPS):
        slopes = squares.slopes(place)
        normal = squares.normal(slopes)
        told.append(variances(normal, count))
        step, _ = squares.step(normal, squares.descent(slopes, place), 0.0, place.point)
        step[:count] = np.clip(step[:count], -1.0, 1.0)
        for share in (1.0, 0.3, 0.1):
            trial = squares.at(squares.moved(place.point, share * step))
            gain = place.whole - trial.whole
            if gain > 0.0:
                place = trial
                break
        if gain < LAST_GAIN:
            break
    seen = told[-1] > 0.0
    wider = np.sqrt(np.where(seen, np.max(told, axis=0), 1.0) / np.where(seen, told[-1], 1.0))
    return Fitted(fitted.terms, unknowns, place.point, place.residuals, place.cost, tuple(noises), normal, wider)


def cost_at(problem: Problem, fitted: Fitted, point: Point, noises: Sequence[Noise]) -> float:
    """Return the cost of a fit's hypothesis at another point, tied to what is known beforehand."""
    return squares_of(problem, fitted, noises).at(point).whole


def moved(problem: Problem, fitted: Fitted, step: Array) -> Point:
    """Return the point a step (k + s w,) of all unknowns away from a fit."""
    return SumOfSquares(problem, problem.train, fitted.coordinates, (), np.zeros((0, 1))).moved(fitted.point, step)


def variances(normal: Array, count: int) -> Array:
    """Return the variances (k,) of the first `count` coordinates."""
    return np.asarray(np.diag(inverse(normal))[:count])


def strength(fitted: Fitted, term: LibraryTerm) -> float:
    """Return how many deviations a term is from changing nothing: its first parameter, or the surest of its sizes.

    Beside the inertia as found: what is known but for a factor that all torques have in common may not be nothing.
    """
    known, switches = beside_scale(fitted), term.effect.switches
    found = []
    for place in switches if len(switches) > 1 else range(min(1, len(term.keys))):
        neutral, key = term.parameters[place].neutral, term.keys[place]
        off = fitted.point.values[key] - (neutral if place in switches and math.isfinite(neutral) else 0.0)
        deviation = known.get(key, math.inf)
        found.append(abs(off) / deviation if deviation > 0.0 else math.inf)
    return max(found, default=math.inf)


def beside_scale(fitted: Fitted) -> Mapping[str, float]:
    """Return one standard deviation of every parameter: of a torque or a force, if the scale of all were known."""
    alone = deviations(fitted, inertia_of(fitted.coordinates))
    return {name: alone[name] if on_scale_of_torques(name) else each for name, each in deviations(fitted).items()}


def deviations(fitted: Fitted, held: Collection[str] = ()) -> Mapping[str, float]:
    """Return one standard deviation of every parameter, in its unit; 0 of what is `held`, and beside that."""
    count = len(fitted.coordinates)
    free = [k for k in range(len(fitted.normal)) if k >= count or fitted.coordinates[k].name not in held]
    spread = np.zeros(len(fitted.normal))
    spread[free] = np.sqrt(np.maximum(variances(fitted.normal[np.ix_(free, free)], len(free)), 0.0))
    met = np.diag(fitted.normal) > UNSEEN
    found = {}
    for index, each in enumerate(fitted.coordinates):
        inner = each.gradient(fitted.point.values.get(each.name, 0.0))
        wider = 1.0 if fitted.wider is None else float(fitted.wider[index])
        found[each.name] = float(spread[index] * abs(inner)) * wider if met[index] else math.inf
    return found


def widened(fitted: Fitted, factors: Array) -> Fitted:
    """Return the fit with deviations at least `factors` (k,) times what `normal` says."""
    return replace(fitted, wider=factors if fitted.wider is None else np.maximum(fitted.wider, factors))


def doubted(fitted: Fitted, further: Mapping[str, float]) -> Fitted:
    """Return the fit with further deviations of parameters, each independent of what else they are uncertain by."""
    if not any(further.values()):
        return fitted
    factors = np.ones(len(fitted.coordinates)) if fitted.wider is None else np.array(fitted.wider)
    told = deviations(fitted)
    for index, each in enumerate(fitted.coordinates):
        if 0.0 < told[each.name] < math.inf:
            factors[index] *= math.hypot(1.0, further.get(each.name, 0.0) / told[each.name])
    return widened(fitted, factors)


def with_other_answer(fitted: Fitted, values: Mapping[str, float]) -> Fitted:
    """Widen deviations by how far another consistent estimate is off, that of plain simulation error.

    Both are near the truth where the noise model is right; how far they are apart is its doubt (Hausman, Econometrica
    46 (1978) 1251-1271).
    """
    own, factors = np.diag(inverse(fitted.normal)), []
    for index, each in enumerate(fitted.coordinates):
        here, there = (each.inner(known.get(each.name, 0.0)) for known in (fitted.point.values, values))
        wider = 1.0 if fitted.wider is None else float(fitted.wider[index])
        apart = (here - there) ** 2 / own[index] if own[index] > 0.0 else 0.0
        factors.append(math.sqrt(wider**2 + apart) if math.isfinite(apart) else wider)
    return widened(fitted, np.array(factors))


def inverse(normal: Array, least: float = 1e-14) -> Array:
    """Return the pseudo-inverse of a symmetric matrix, whatever the sizes of its coordinates.

    Combinations whose singular value is below `least` of the largest are taken to have none, and so is a coordinate
    that leaves no trace: the phase of a wave of nothing.
    """
    seen = np.diag(normal) > UNSEEN
    sizes = np.sqrt(np.diag(normal)[seen])
    found = np.zeros_like(normal)
    scaled = normal[np.ix_(seen, seen)] / np.outer(sizes, sizes)
    found[np.ix_(seen, seen)] = np.linalg.pinv(scaled, rcond=least) / np.outer(sizes, sizes)
    return found


def tethers(problem: Problem, unknowns: Sequence[Unknown]) -> Array:
    """Return rows [weights over the coordinates, aim] of what is known beforehand, in standard deviations."""
    given = {p.name: p.value for p in problem.plant.parameters}
    places = {each.name: index for index, each in enumerate(unknowns)}
    rows = []
    for each in unknowns:
        if each.name in given and np.isfinite(given[each.name]):
            row = np.zeros(len(unknowns) + 1)
            row[places[each.name]] = 1.0 / (GIVEN_DEVIATION if each.logarithmic else LEASH)
            row[-1] = row[places[each.name]] * each.inner(given[each.name])
            rows.append(row)
    ke, kt = given.get("ke_V_s_rad", 0.0), given.get("kt_N_m_A", 0.0)
    if ke > 0.0 and kt > 0.0 and abs(np.log(kt / ke)) < SAME_CONSTANT:
        row = np.zeros(len(unknowns) + 1)
        for name, sign, fixed in (("kt_N_m_A", 1.0, kt), ("ke_V_s_rad", -1.0, ke)):
            if name in places:
                row[places[name]] = sign / CONSTANT_DEVIATION
            else:
                row[-1] -= sign * np.log(fixed) / CONSTANT_DEVIATION
        rows.append(row)
    return np.array(rows).reshape(len(rows), len(unknowns) + 1)


def fit_starts(
    problem: Problem,
    recordings: Sequence[Recording],
    values: Mapping[str, float],
    noises: Sequence[Noise],
    near: Mapping[int, Array] | None = None,
) -> Point:
    """Fit the initial states alone, from rest by Gauss-Newton steps, all but the first with exact slopes.

    And from what `near` says by the id of a recording, where that ends nearer; of what moves by itself also over
    stretches that grow: behind every swing that a guess is off, it has another phase.
    """
    starts = []
    for recording in recordings:
        squares = SumOfSquares(problem, [recording], (), noises, np.zeros((0, 1)))
        begins = [full_start(problem, recording)]
        if near and id(recording) in near:
            begins.append(near[id(recording)])
        if by_itself(problem.plant, recording):
            begins.append(_grown(problem, recording, values, begins[-1], noises))
        places = [_begun(problem, squares, Point(values, (begin,))) for begin in begins]
        starts.append(min(places, key=lambda place: place.cost).point.starts[0])
    return Point(values, tuple(starts))


def _grown(
    problem: Problem, recording: Recording, values: Mapping[str, float], start: Array, noises: Sequence[Noise]
) -> Array:
    """Return the initial state that the first rows are met with, and more and more of them."""
    for rows in stretches(len(recording.time), len(start)):
        squares = SumOfSquares(replace(problem, memory={}), [recording.part(0, rows)], (), noises, np.zeros((0, 1)))
        start = _begun(problem, squares, Point(values, (start,))).point.starts[0]
    return start


def _begun(problem: Problem, squares: SumOfSquares, point: Point) -> Place:
    """Return where the initial state of one recording ends from a point."""
    place = squares.at(point)
    for exact in (False, True, True, True) if problem.engine.states else ():
        slopes = squares.slopes(place, squares.start_slopes(place.point, exact=True) if exact else None)
        normal, pulled = squares.normal(slopes), squares.descent(slopes, place)
        trial = squares.at(squares.moved(place.point, solved(normal, pulled, 1e-9)))
        if exact and not trial.cost < place.cost:
            # What rests lets a speed look like a place: together they lead away, the place alone does not.
            alone = np.diag(pulled / np.maximum(np.diag(normal), 1e-300))
            trial = min((squares.at(squares.moved(place.point, step)) for step in alone), key=lambda one: one.cost)
        gain = place.cost - trial.cost
        if gain > 0.0:
            place = trial
        if exact and gain < SETTLED_START * place.cost:
            break
    return place


def own_evidence(problem: Problem, fitted: Fitted) -> float:
    """Return the evidence of a fit with the noise it leaves."""
    return evidence(fitted, noises_of(problem, fitted.residuals))


def evidence(fitted: Fitted, noises: Sequence[Noise]) -> float:
    """Return -2 log likelihood + BIC penalty; innovations have the variance that each output's noise model says.

    Infinite for a simulation that has diverged.
    """
    rows = sum(len(part) for part in fitted.residuals)
    own = sum(noise.unlikely(rows) for noise in noises)
    unknowns = len(fitted.coordinates)
    total = float(own + unknowns * np.log(rows * sum(noise.samples for noise in noises)))
    return total if np.isfinite(total) else np.inf
