"""Pose the fit of a plant as nonlinear least squares, and solve it from one start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.experiment import Experiment, conditioned, delayed, misfit, plainly_conditioned
from firmloop.identify.fitting.least_squares import Reduced, Unknowns, joined, minimize, triangle
from firmloop.identify.fitting.stretches import stretches
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import MOST_STEPS, Engine

Array = NDArray[np.float64]
_T = TypeVar("_T")

_FAR = 1e9  # times the noise: what a diverged simulation counts
_STEEP = 1e15  # slopes beyond it belong to such a simulation
LEASH = 10.0  # see FitProblem
_STIFFER = 4.0  # times as many steps as the plant as given
_FEW_STEPS = 4.0  # a row: with fewer, no plant that is given is stiff


@dataclass(frozen=True, slots=True)
class FitProblem:
    """Least squares over coordinates: the free parameters (logarithms of positive ones), then the initial states.

    Each coordinate of a parameter the user gave is held by a leash, a residual of (distance / LEASH): nothing against
    thousands of rows, but it keeps combinations that leave no trace in the data where the user put them.
    """

    plant: Plant
    engine: Engine
    experiments: tuple[Experiment, ...]  # window after window, recording after recording
    windows: tuple[int, ...]  # how many of them each recording has
    free: tuple[int, ...]
    logarithmic: NDArray[np.bool_]  # (f,)
    low: Array  # (f,) coordinates
    high: Array
    leash_centre: Array  # (f,) coordinates
    leash_weight: Array  # (f,) 0 for none
    weights: Array  # (r,) 1 / noise


def make_problem(plant: Plant, engine: Engine, recordings: Sequence[Sequence[Experiment]]) -> FitProblem:
    """Choose coordinates, bounds and first weights (1 / spread of each output)."""
    experiments = tuple(made for parts in recordings for made in parts)
    free = tuple(index for index, parameter in enumerate(plant.parameters) if parameter.free)
    chosen = [plant.parameters[index] for index in free]
    logarithmic = np.array([p.logarithmic or p.low > 0.0 for p in chosen], dtype=bool)
    tiny, huge = 1e-30, 1e30
    low = [math.log(max(p.low, tiny)) if log else p.low for p, log in zip(chosen, logarithmic, strict=True)]
    high = [math.log(min(p.high, huge)) if log else p.high for p, log in zip(chosen, logarithmic, strict=True)]
    values = np.array([p.value for p in chosen])
    # What comes later than the last row leaves no trace, however much later.
    span = max(
        float(made.course.time[made.course.end - 1] - made.course.time[made.course.first]) for made in experiments
    )
    high = [min(top, span) if p.name == plant.delay else top for p, top in zip(chosen, high, strict=True)]
    known = np.isfinite(values) & (values != 0.0)
    centre = np.where(known, values, 1.0)
    scale = np.where(logarithmic, 1.0, np.abs(centre))
    spread = np.std(joined([made.target for made in experiments]), axis=0)
    return FitProblem(
        plant=plant,
        engine=engine,
        experiments=experiments,
        windows=tuple(len(parts) for parts in recordings),
        free=free,
        logarithmic=logarithmic,
        low=np.array(low),
        high=np.array(high),
        leash_centre=np.where(logarithmic, np.log(np.abs(centre)), centre),
        leash_weight=np.where(known, 1.0 / (LEASH * scale), 0.0),
        weights=1.0 / spread,
    )


def loosened(problem: FitProblem, plant: Plant) -> FitProblem:
    """Return the problem of a plant that has fewer values: what has none is held by no leash."""
    unknown = np.array([math.isnan(plant.parameters[index].value) for index in problem.free], dtype=bool)
    return replace(problem, plant=plant, leash_weight=np.where(unknown, 0.0, problem.leash_weight))


def shortened(problem: FitProblem, steps: Sequence[float]) -> FitProblem:
    """Return the problem on the stretches that tell basins apart; itself where its recordings are short."""
    chosen = stretches(problem.experiments, steps)
    if len(chosen) == len(problem.experiments) and chosen[0] is problem.experiments[0]:
        return problem
    return replace(problem, experiments=chosen, windows=(len(chosen),))


def bounded(problem: FitProblem) -> tuple[FitProblem, list[float]]:
    """Let a simulation that takes far more steps than the plant as given count as diverged: nothing can be that stiff.

    A search that strays to a time constant near zero would else wait there for hours. Also return how many steps each
    experiment takes with the plant as given: its rows, where that has no values yet.
    """
    given, still = np.array([p.value for p in problem.plant.parameters]), np.zeros(problem.engine.states)
    known, made, steps = bool(np.all(np.isfinite(given))), [], []
    for each in problem.experiments:
        rows = float(len(each.measured))
        taken = problem.engine.steps_of(each.course, given, still) if known else rows
        most = _STIFFER * max(_FEW_STEPS * rows, taken) if known else MOST_STEPS * rows
        made.append(replace(each, course=replace(each.course, most_steps=most)))
        steps.append(taken)
    return replace(problem, experiments=tuple(made)), steps


@dataclass(frozen=True, slots=True)
class FitPoint:
    """All constants (k,), and the initial state of every experiment (w, n)."""

    constants: Array
    starts: Array


def coordinates(problem: FitProblem, constants: Array) -> Array:
    """Return where the free parameters (f,) of all constants (k,) are."""
    values = constants[list(problem.free)]
    return np.where(problem.logarithmic, np.log(np.where(problem.logarithmic, values, 1.0)), values)


def at_coordinates(problem: FitProblem, base: Array, place: Array, starts: Array) -> FitPoint:
    """Return the point whose free parameters are at `place` (f,), and whose others are those of `base` (k,)."""
    constants = base.copy()
    constants[list(problem.free)] = np.where(
        problem.logarithmic, np.exp(np.where(problem.logarithmic, place, 0.0)), place
    )
    return FitPoint(constants, starts)


def weighted(problem: FitProblem, point: FitPoint) -> Iterator[tuple[Array, Array]]:
    """Yield per experiment the weighted residuals (q, r) and their slopes (q, r, f + n) for its coordinates."""
    count = len(problem.free)
    inner = np.where(problem.logarithmic, point.constants[list(problem.free)], 1.0)
    for made, start in zip(problem.experiments, point.starts, strict=True):
        residual, slopes = misfit(made, problem.engine, point.constants, start, problem.free)
        with np.errstate(over="ignore"):  # a trial that has diverged counts as far off
            residual *= problem.weights
            slopes[..., :count] *= inner
            slopes *= problem.weights[:, None]
        yield residual, slopes


def solve(problem: FitProblem, begin: FitPoint, evaluations: int) -> tuple[FitPoint, float]:
    """Search from `begin`; return where it ended and half the mean squared weighted residual there."""
    count = len(problem.free)

    def evaluate(unknowns: Unknowns) -> Reduced:
        blocks = []
        for residual, slopes in weighted(
            problem, at_coordinates(problem, begin.constants, unknowns.shared, unknowns.own)
        ):
            aim, tall = residual.reshape(-1), slopes.reshape(-1, slopes.shape[2])
            if not (_within(aim, _FAR) and _within(tall, _STEEP)):
                aim = np.clip(np.nan_to_num(aim, nan=_FAR, posinf=_FAR, neginf=-_FAR), -_FAR, _FAR)
                np.clip(np.nan_to_num(tall, copy=False, nan=0.0), -_STEEP, _STEEP, out=tall)
            blocks.append(triangle(tall[:, count:], tall[:, :count], aim[:, None]))
        leash = (unknowns.shared - problem.leash_centre) * problem.leash_weight
        return Reduced(np.stack(blocks), np.column_stack([np.diag(problem.leash_weight), leash]))

    place = np.clip(coordinates(problem, begin.constants), problem.low, problem.high)
    found = minimize(evaluate, Unknowns(place, begin.starts), problem.low, problem.high, evaluations)
    rows = sum(made.target.size for made in problem.experiments)
    return at_coordinates(problem, begin.constants, found.place.shared, found.place.own), 0.5 * found.cost / rows


def _within(values: Array, most: float) -> bool:
    """Tell whether all values are numbers no larger than `most`; sizes of their own would be as long as the slopes."""
    return bool(-most <= np.min(values, initial=0.0) and np.max(values, initial=0.0) <= most)


def plain_residuals(problem: FitProblem, at: FitPoint) -> list[Array]:
    """Return the residuals (q, r) of each experiment without what smoothing makes of them."""
    plain = [plainly_conditioned(made) for made in problem.experiments]
    return [
        made.target - conditioned(made, delayed(made, problem.engine.run(made.course, at.constants, start)))
        for made, start in zip(plain, at.starts, strict=True)
    ]


def by_recording(problem: FitProblem, values: Sequence[_T]) -> list[Sequence[_T]]:
    """Group what stands window after window by recording."""
    edges = np.cumsum([0, *problem.windows]).tolist()
    return [values[first:end] for first, end in pairwise(edges)]
