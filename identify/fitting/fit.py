"""Fit a plant to recordings: simulation-error least squares with every initial state free."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.alignment import lag_slopes, lag_steps
from firmloop.identify.fitting.covariance import Doubt, as_found, possible, uncertainty, untold
from firmloop.identify.fitting.experiment import (
    Experiment,
    aligned,
    best_start,
    conditioned,
    delayed,
    experiments,
)
from firmloop.identify.fitting.hardly_told import hardly_told
from firmloop.identify.fitting.least_squares import joined
from firmloop.identify.fitting.own_values import OwnValue, own_values, unseen_own
from firmloop.identify.fitting.problem import (
    FitPoint,
    FitProblem,
    bounded,
    by_recording,
    make_problem,
    plain_residuals,
    shortened,
    solve,
    weighted,
)
from firmloop.identify.fitting.residual_tests import POOR, likelier, slow, unexplained
from firmloop.identify.fitting.scores import RecordingScore, scores
from firmloop.identify.fitting.starting_points import starting_points, unguided, without_far_values
from firmloop.identify.fitting.sufficiency import (
    check_answer,
    check_delay,
    check_follows,
    check_moving,
    check_rows,
    check_span,
    check_step,
)
from firmloop.identify.plants.per_recording import centred, in_common, without_value
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import Conditioning
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.course import Engine
from firmloop.identify.simulation.simulate import constants_of, measured, simulator

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_TRIAL_STEPS = 25  # per start; enough to see which basin it is in
_FINAL_STEPS = 200
_KINKED_STEPS = 30  # where a friction sticks the cost has kinks, and what comes after is worth less than 1e-6 of it
_PASSES = 6  # of weighting; two or three settle
_TURNS = 30  # of aligning clocks; each about halves what is left
_JOINT_TURNS = 8  # of aligning them together with the parameters; two or three settle
_DIVERGED = 1e12  # half the mean squared residual over the spread: a million times what was measured
CERTAIN = 16.0  # by which twice the log likelihood rises; 1 in 16,000 by chance
_CLOSE = 0.01  # rows; clocks closer than this are aligned
_SMALLEST_SHARE = 1e-9  # of a signal's spread: noise below it is rounding


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted plant and how far to trust it.

    `covariance` is that of the `free` parameters, in their units; rows of parameters the data cannot tell are NaN and
    their deviation is None. `noise` is the residual rms per output on the training recordings. `starts` are the costs
    (half the mean squared weighted residual of the trial runs, which see stretches of long recordings) of every start,
    in the order tried. `per_recording` is what each recording has of what differs between them.
    """

    plant: Plant
    covariance: Array  # (f, f)
    free: tuple[str, ...]
    train: tuple[RecordingScore, ...]
    test: tuple[RecordingScore, ...]
    noise: Mapping[str, float]  # output's unit
    starts: tuple[float, ...]
    warnings: tuple[str, ...]
    per_recording: tuple[OwnValue, ...] = ()
    slow: bool = False  # what is left of some output moves slowly, as noise of a sensor does not
    lacking: bool = False  # a check says that what is left is no noise, or why the fit is poor

    @property
    def explained(self) -> float:
        """The least share of an output's variance that is explained in a train recording."""
        return min(figures.r2 for one in self.train for figures in one.scores.values())


def fit(
    plant: Plant,
    train: Sequence[Recording],
    test: Sequence[Recording],
    conditioning: Conditioning,
    progress: Progress | None = None,
) -> Fit:
    """Find the free parameters that make the simulated outputs come closest to those of `train`.

    IdentifyError where the recordings cannot tell what the plant is asked for.
    """
    found = estimate(plant, train, test, conditioning, progress)
    judge(found, train, conditioning)
    return found


def judge(found: Fit, train: Sequence[Recording], conditioning: Conditioning) -> None:
    """Raise IdentifyError where a gain is wanted that the recordings do not show."""
    seen = [experiments(found.plant, recording, conditioning) for recording in train]
    if found.explained < POOR and found.slow and not _drifts(found, train, conditioning):
        check_follows(found.plant, found.explained, seen)
    else:
        check_span(found.plant, found.free, found.covariance, seen)
    gain = next((each for each in found.plant.parameters if each.name == "gain" and each.free), None)
    if gain is not None and gain.may_be_zero and not _surely_answers(found, train, conditioning, seen):
        check_answer(found.plant, gain, found.explained, found.slow, seen)


def _drifts(found: Fit, train: Sequence[Recording], conditioning: Conditioning) -> bool:
    """Tell whether the kind follows the outputs once a straight line is taken out of them."""
    bare = unguided(found.plant)
    if bare is None:
        return False
    after = tried(bare, train, replace(conditioning, detrend=tuple(found.noise)))
    return after is not None and after.explained >= POOR


def _surely_answers(
    found: Fit, train: Sequence[Recording], conditioning: Conditioning, seen: Sequence[Sequence[Experiment]]
) -> bool:
    """Tell whether the best fit in which no input acts leaves more beyond doubt, whatever interval the gain has.

    A gain may be unknown for a time constant that is: what follows its input still follows it.
    """
    if not any(np.any(np.diff(made.course.drive[:, 0]) < 0.0) for parts in seen for made in parts):
        return False  # a drift would do as much
    fixed = tuple(replace(p, value=0.0, free=False) if p.name == "gain" else p for p in found.plant.parameters)
    still = tried(replace(found.plant, parameters=fixed), train, conditioning, near=True)
    if still is None:
        return False
    left = [measured(found.plant, one) - score.simulated for one, score in zip(train, found.train, strict=True)]
    return likelier(still.noise, found.noise, left) > CERTAIN


def estimate(
    plant: Plant,
    train: Sequence[Recording],
    test: Sequence[Recording],
    conditioning: Conditioning,
    progress: Progress | None = None,
    near: bool = False,
    doubt: Doubt = uncertainty,
) -> Fit:
    """Fit as `fit` does, and leave the answer to be judged; `untold` spares the intervals of one that is only compared.

    The model is driven by the recorded input alone. Outputs are weighted by 1 / residual rms, found by repeating the
    fit until the weights stay (maximum likelihood for white noise of unknown size). Of a `test` recording only the
    initial state is estimated. `progress` is called with the fraction done and what is being done. `near` values, of
    a fit to much the same, are the only start.
    """
    report = progress or _silent
    if not train:
        raise IdentifyError("recordings.train is empty; name at least one recording to fit to")
    plant = _begun(plant, train, conditioning)
    engine = simulator(plant, train[0].hold)
    seen = [experiments(plant, recording, conditioning) for recording in train]
    unseen = [experiments(plant, recording, conditioning) for recording in test]
    check_moving(seen)
    check_rows(plant, seen)
    check_delay(plant, seen)
    check_step(plant, seen)
    report(0.05, "choosing starting values")
    problem, steps = bounded(make_problem(plant, engine, seen))
    problem = problem if near else without_far_values(problem, steps)
    tried = shortened(problem, steps)
    starts = (constants_of(plant),) if near else starting_points(problem.plant, engine, tried.experiments)
    best, costs = _best_trial(tried, starts, report)
    if not min(costs) < _DIVERGED:
        raise IdentifyError(
            "every simulation of the plant diverges on these recordings, from all start values tried; it may be "
            "unstable and held by its controller alone: use shorter recordings, or start values nearer to the machine's"
        )
    if tried is not problem:
        best = FitPoint(best.constants, _best_starts(problem, best.constants, problem.experiments))
    best, problem = _settle(problem, best, report, 0.6)
    if conditioning.align:
        best, problem = _align(problem, best, report)
    report(0.9, "covariance and scores")
    best = FitPoint(*centred(plant, best.constants, best.starts))
    scored = tuple(_unseen_score(problem, best, parts) for parts in unseen)
    found = _result(plant, problem, best, scored, costs, doubt)
    own = [
        unseen_own(found.plant, problem.engine, problem.weights, parts, score)
        for parts, score in zip(unseen, scored, strict=True)
    ]
    return replace(found, per_recording=(*found.per_recording, *chain.from_iterable(own)))


def about_means(plant: Plant, train: Sequence[Recording], conditioning: Conditioning) -> Plant | None:
    """Return the plant that fits all deviations from the means, in which no level takes part; None where none does."""
    signals = tuple(signal.name for signal in (*plant.inputs, *plant.outputs))
    found = tried(plant, train, replace(conditioning, remove_offset=signals))
    return None if found is None else found.plant


def tried(plant: Plant, train: Sequence[Recording], conditioning: Conditioning, near: bool = False) -> Fit | None:
    """Return a fit that is only compared, without intervals; None where none can be made."""
    try:
        return estimate(plant, train, (), conditioning, near=near, doubt=untold)
    except IdentifyError:
        return None


def _begun(plant: Plant, train: Sequence[Recording], conditioning: Conditioning) -> Plant:
    """Return the plant with a value for what each recording has its own of: that of a fit in which all share it."""
    if plant.varying and conditioning.window_s > 0.0:
        raise IdentifyError(
            "recordings.per_recording: a value of one recording is fitted over the whole of it; remove "
            "recordings.conditioning.window_s"
        )
    named = without_value(plant)
    if not named:
        return plant
    shared = estimate(in_common(plant, named), train, (), conditioning, doubt=untold).plant
    return plant.valued({p.name: p.value for p in shared.parameters})


def _silent(fraction: float, label: str) -> None:
    """Report progress to nobody."""


def _best_trial(
    problem: FitProblem, constants: Sequence[Array], report: Progress
) -> tuple[FitPoint, tuple[float, ...]]:
    ends = []
    for index, start in enumerate(constants):
        report(0.1 + 0.4 * index / len(constants), f"start {index + 1} of {len(constants)}")
        ends.append(solve(problem, FitPoint(start, _best_starts(problem, start, problem.experiments)), _TRIAL_STEPS))
    costs = tuple(cost for _, cost in ends)
    return ends[int(np.argmin(costs))][0], costs


def _best_starts(problem: FitProblem, constants: Array, parts: Sequence[Experiment]) -> Array:
    """Return the initial states (w, n) that suit given constants."""
    still = np.zeros(problem.engine.states)
    return np.stack([best_start(made, problem.engine, constants, still, problem.weights) for made in parts])


def _settle(problem: FitProblem, begin: FitPoint, report: Progress, fraction: float) -> tuple[FitPoint, FitProblem]:
    """Repeat fit and weighting until the weights stay."""
    point = begin
    spread = np.std(joined([made.target for made in problem.experiments]), axis=0)
    for turn in range(_PASSES):
        report(fraction + 0.02 * turn, f"fitting, weights {turn + 1}")
        residuals = joined([residual for residual, _ in weighted(problem, point)])
        rms = np.sqrt(np.mean(residuals**2, axis=0)) / problem.weights
        weights = 1.0 / np.maximum(rms, _SMALLEST_SHARE * spread)
        done = turn > 0 and bool(np.all(np.abs(weights / problem.weights - 1.0) < 0.02))
        problem = replace(problem, weights=weights)
        if done:
            break
        point, _ = solve(problem, point, _KINKED_STEPS if problem.plant.effects else _FINAL_STEPS)
    return point, problem


def _align(problem: FitProblem, begin: FitPoint, report: Progress) -> tuple[FitPoint, FitProblem]:
    """Find the clock differences and fit again, in turns: a lag that was not known had been taken for slowness."""
    point = begin
    for turn in range(_TURNS):
        report(0.75 + 0.14 * turn / _TURNS, f"aligning clocks {turn + 1}")
        shifted: list[Experiment] = []
        begun = by_recording(problem, list(point.starts))
        for parts, starts in zip(by_recording(problem, problem.experiments), begun, strict=True):
            shifted.extend(aligned(parts, _run(problem.engine, point.constants, parts, starts)))
        change = max(
            abs(late - old.lags.get(name, 0.0)) / new.course.step
            for old, new in zip(problem.experiments, shifted, strict=True)
            for name, late in new.lags.items()
        )
        problem = replace(problem, experiments=tuple(shifted))
        point, problem = _settle(problem, point, _silent, 0.0)
        if change < _CLOSE:
            break
    return _realigned(problem, point)


def _realigned(problem: FitProblem, begin: FitPoint) -> tuple[FitPoint, FitProblem]:
    """Take lags and parameters to their common minimum: in turns they come near it ever more slowly."""
    point, members = begin, by_recording(problem, list(range(len(problem.experiments))))
    for _ in range(_JOINT_TURNS):
        steps = lag_steps(problem, point, members)
        shifted: list[Experiment] = []
        for parts, step in zip(by_recording(problem, problem.experiments), steps, strict=True):
            longest = parts[0].conditioning.align_max_lag_s
            lags = {
                name: float(np.clip(late + more, -longest, longest))
                for (name, late), more in zip(parts[0].lags.items(), step, strict=True)
            }
            shifted += [replace(made, lags=lags) for made in parts]
        problem = replace(problem, experiments=tuple(shifted))
        point, problem = _settle(problem, point, _silent, 0.0)
        if all(np.all(np.abs(step) < _CLOSE * shifted[0].course.step) for step in steps):
            break
    return point, problem


def _run(engine: Engine, constants: Array, parts: Sequence[Experiment], starts: Sequence[Array]) -> list[Array]:
    return [engine.run(made.course, constants, start) for made, start in zip(parts, starts, strict=True)]


def _unseen_score(problem: FitProblem, point: FitPoint, parts: Sequence[Experiment]) -> RecordingScore:
    """Score a recording after fitting its initial states, and its clocks where clocks are to be aligned."""
    starts = _best_starts(problem, point.constants, parts)
    if parts[0].conditioning.align:
        parts = aligned(parts, _run(problem.engine, point.constants, parts, list(starts)))
        starts = _best_starts(problem, point.constants, parts)
    return _score(problem.engine, point.constants, parts, list(starts))


def _result(
    plant: Plant,
    problem: FitProblem,
    best: FitPoint,
    test: tuple[RecordingScore, ...],
    costs: tuple[float, ...],
    doubt: Doubt,
) -> Fit:
    pairs = list(weighted(problem, best))
    residuals = [residual for residual, _ in pairs]
    count = len(problem.free)
    values = best.constants[list(problem.free)]
    inner = np.where(problem.logarithmic, values, 1.0)
    natural = np.where(problem.logarithmic, 1.0, np.abs(values))
    # An aligned clock is one more unknown of its own, as an initial state is.
    whole = [
        np.concatenate([slopes, own], axis=2) if own.shape[2] else slopes
        for (_, slopes), own in zip(pairs, lag_slopes(problem, best), strict=True)
    ]
    found = doubt(problem.windows, residuals, whole, natural)
    covariance = found.covariance * np.outer(inner, inner)
    covariance[list(found.blind), :] = math.nan
    covariance[:, list(found.blind)] = math.nan
    told = np.sqrt(sum(np.sum(slopes[..., :count] ** 2, axis=(0, 1)) for slopes in whole))
    alone = np.abs(inner) / np.maximum(told, 1e-300)  # deviations beside the others as they are
    spread = zip(np.sqrt(np.diag(covariance)).tolist(), alone.tolist(), strict=True)
    deviations = dict(zip(problem.free, spread, strict=True))
    parameters = tuple(
        as_found(parameter, float(best.constants[index]), *deviations.get(index, (math.nan, math.nan)))
        for index, parameter in enumerate(plant.parameters)
    )
    if not possible(plant, parameters):
        inside = zip(parameters, best.constants.tolist(), strict=True)
        parameters = tuple(replace(parameter, value=value) for parameter, value in inside)
    every = joined(residuals)
    unknowns = (count + best.starts.size) / every.shape[1]
    noise = np.sqrt(np.sum(every**2, axis=0) / max(len(every) - unknowns, 1.0)) / problem.weights
    fitted = replace(plant, parameters=parameters)
    grouped, began = by_recording(problem, problem.experiments), by_recording(problem, list(best.starts))
    train = tuple(
        _score(problem.engine, best.constants, parts, starts) for parts, starts in zip(grouped, began, strict=True)
    )
    left = [joined(parts).T for parts in by_recording(problem, plain_residuals(problem, best))]
    poor = [
        said
        for one, columns in zip(train, left, strict=True)
        for column, (name, figures) in zip(columns, one.scores.items(), strict=True)
        for said in unexplained(plant.kind, one.source, name, column, figures.r2)
    ]
    drifts = any(slow(column) for columns in left for column in columns)
    return Fit(
        plant=fitted,
        covariance=covariance,
        free=tuple(plant.parameters[index].name for index in problem.free),
        train=train,
        test=test,
        noise={signal.name: float(size) for signal, size in zip(plant.outputs, noise, strict=True)},
        starts=costs,
        warnings=(*hardly_told(fitted, problem.free, found, drifts), *poor),
        per_recording=own_values(fitted, [one.source for one in train], best.starts, residuals, whole, count, doubt),
        slow=drifts,
    )


def _score(engine: Engine, constants: Array, parts: Sequence[Experiment], starts: Sequence[Array]) -> RecordingScore:
    outputs = [delayed(made, run) for made, run in zip(parts, _run(engine, constants, parts, starts), strict=True)]
    shown = joined([conditioned(made, run) for made, run in zip(parts, outputs, strict=True)])
    target = joined([made.target for made in parts])
    each = {name: scores(target[:, k], shown[:, k]) for k, name in enumerate(parts[0].names)}
    return RecordingScore(parts[0].source, each, joined(outputs), np.stack(starts), parts[0].lags)
