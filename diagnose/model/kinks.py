"""Take a fit by simulation error to its very end, past the kinks that limits make.

Parameters that trade with each other need more steps than a search gives. A limit has a kink in its cost at every row
that just reaches it, where a search ends too early; it starts again with each limit moved a little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, fit
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, declared
from firmloop.diagnose.policy import (
    FIT_PATIENCE,
    LEAST_KINK_DECREASE,
    LIMIT_NUDGES,
    LONGER,
    MOST_KINK_SOLVES,
    STEPS_AT_ONCE,
    STEPS_PAST_KINKS,
)
from firmloop.identify.fitting.experiment import Experiment, experiments
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.fitting.problem import FitPoint, FitProblem, make_problem, solve
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import constants_of, simulator


def polished(problem: Problem, fitted: Fitted, noises: Sequence[Noise], most: int = MOST_KINK_SOLVES) -> Fitted:
    """Return the fit at its minimum of the plain squared error, outputs weighted by 1 / noise rms.

    After `most` solves of a few steps each it stays where it is, and before one where that would take too long.
    """
    values = fitted.point.values
    plant = problem.plant.valued(values)
    plant = with_effects(plant, [*declared(plant, fitted.terms), *(term.use(values) for term in fitted.terms)])
    engine = simulator(plant, problem.train[0].hold)
    took = SumOfSquares(problem, problem.train, (), noises, np.zeros((0, 1))).at(fitted.point).took
    parts = [_bounded(plant, each, LONGER * 1e6 * steps) for each, steps in zip(problem.train, took, strict=True)]
    fit_problem = make_problem(plant, engine, parts)
    fit_problem = replace(fit_problem, weights=np.array([1.0 / noise.rms for noise in noises]))
    starts = np.stack([start[: engine.states] for start in fitted.point.starts])
    constants = constants_of(plant)
    if STEPS_AT_ONCE * 2 * (len(fit_problem.free) + starts.size) * sum(took) > FIT_PATIENCE:
        return fitted
    place, cost, left = _solved(fit_problem, FitPoint(constants, starts), most)
    kinked = limits(fitted.terms)
    places = [k for k, p in enumerate(plant.parameters) if p.name in kinked]
    for index in places:
        for factor in LIMIT_NUDGES:
            if left <= 0:
                break
            nudged = place.constants.copy()
            nudged[index] *= factor
            trial, less, left = _solved(fit_problem, FitPoint(nudged, place.starts), left)
            if less < cost:
                place, cost = trial, less
    moved = {p.name: float(value) for p, value in zip(plant.parameters, place.constants, strict=True)}
    begun = tuple(
        np.concatenate([near, start[engine.states :]])
        for near, start in zip(place.starts, fitted.point.starts, strict=True)
    )
    return fit(problem, problem.train, fitted.terms, Point({**values, **moved}, begun), noises, 0)


def _bounded(plant: Plant, recording: Recording, most: float) -> tuple[Experiment, ...]:
    """Return what a recording is compared with; a simulation of more than so many steps counts as diverged."""
    return tuple(
        replace(made, course=replace(made.course, most_steps=most)) for made in experiments(plant, recording, NONE)
    )


def _solved(fit_problem: FitProblem, place: FitPoint, most: int) -> tuple[FitPoint, float, int]:
    """Minimize, a few steps at once, in at most `most` solves; return how many of them are left too."""
    cost = math.inf
    for _ in range(min(STEPS_PAST_KINKS // STEPS_AT_ONCE, most)):
        most -= 1
        next_place, next_cost = solve(fit_problem, place, STEPS_AT_ONCE)
        if not next_cost < cost * (1.0 - LEAST_KINK_DECREASE):
            break
        place, cost = next_place, next_cost
    return place, cost, most


def limits(terms: Sequence[LibraryTerm]) -> set[str]:
    """Name the parameters that bound something: they are neutral where they are infinite."""
    return {
        key for term in terms for key, each in zip(term.keys, term.parameters, strict=True) if math.isinf(each.neutral)
    }
