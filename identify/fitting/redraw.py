"""Refit a plant to data drawn anew, to see how far its parameters scatter without trusting a linearization.

Monte Carlo draws white noise of the size that the fit left over. The moving-block bootstrap draws blocks of the
residuals themselves, so that coloured ones stay coloured (H. R. Kunsch, Annals of Statistics 17 (1989) 1217-1241; block
length n^(1/3), P. Hall, J. L. Horowitz and B.-Y. Jing, Biometrika 82 (1995) 561-574). What is drawn is added to the
simulated outputs before they are conditioned; every draw is fitted by Gauss-Newton from the estimate, on simulations
that are expanded to second order there. The draws that end farthest are fitted on whole simulations too: where one of
them ends elsewhere, all of them are. Intervals are the 2.5 and 97.5 percentiles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.expansion import Expansion, Pair, expand
from firmloop.identify.fitting.experiment import conditioned, delayed, experiments, plainly_conditioned, rows_time
from firmloop.identify.fitting.fit import Fit, Progress
from firmloop.identify.fitting.least_squares import scaled_step
from firmloop.identify.fitting.problem import FitPoint, FitProblem, at_coordinates, coordinates, make_problem, weighted
from firmloop.identify.recordings.conditioning import Conditioning, compared_time, interpolate, line_free
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import constants_of, simulator

Array = NDArray[np.float64]
Noise = Callable[[Array, np.random.Generator], Array]  # residuals (n, r) -> as many drawn ones

DETERMINED = 1e-13  # of the best determined direction: less is not moved along
CLOSE = 0.02  # of a standard deviation: Gauss-Newton squares the distance, so that what is left moves no interval
MOST_STEPS = 16
WHOLE_STEPS = 4  # then halves: at a kink, such as a delay that passes a row, whole ones jump across it for ever
SLOW = 200  # draws between two reports of progress, and at a time
CHECKED = 12  # draws that are fitted to whole simulations too


@dataclass(frozen=True, slots=True)
class Redrawn:
    """`draws` (d, f) of the free parameters, in their units; `failed` refits did not settle and are left out."""

    names: tuple[str, ...]
    draws: Array
    failed: int

    def interval_95(self, name: str) -> tuple[float, float]:
        """2.5 and 97.5 percentile of one parameter."""
        low, high = np.percentile(self.draws[:, self.names.index(name)], [2.5, 97.5])
        return float(low), float(high)


def white(residual: Array, random: np.random.Generator) -> Array:
    """Draw white noise with the rms of each column of `residual` (n, r)."""
    return np.asarray(random.standard_normal(residual.shape) * np.sqrt(np.mean(residual**2, axis=0)))


def blocks(residual: Array, random: np.random.Generator) -> Array:
    """Draw blocks of rows of `residual` (n, r) with replacement."""
    rows = len(residual)
    length = max(1, math.ceil(rows ** (1 / 3)))
    starts = random.integers(0, rows - length + 1, math.ceil(rows / length))
    return np.concatenate([residual[first : first + length] for first in starts])[:rows]


def redraw(
    fit: Fit,
    train: Sequence[Recording],
    conditioning: Conditioning,
    noise: Noise,
    draws: int,
    seed: int,
    report: Progress,
) -> Redrawn:
    """Refit `draws` times; `fit` is what `firmloop.identify.fitting.fit.fit` found on `train` under `conditioning`.

    Raises
    ------
    IdentifyError
        when a free parameter has no interval at all, or most refits do not settle.
    """
    problem, point = _posed(fit, train, conditioning)
    free = list(problem.free)
    if not free:
        raise IdentifyError(
            "plant.parameters: none is free, so that there is no interval to examine; set free = true for those "
            "that recordings shall tell, or take `firmloop identify`, which scores a plant as it is given"
        )
    unsure = [fit.plant.parameters[k].name for k in free if fit.plant.parameters[k].deviation is None]
    if unsure:
        raise IdentifyError(f"plant.parameters.{unsure[0]} has no interval to be checked; fix it with free = false")
    simulated = [
        delayed(made, problem.engine.run(made.course, point.constants, start))
        for made, start in zip(problem.experiments, point.starts, strict=True)
    ]
    rows = sum(made.measured.shape[0] for made in problem.experiments)
    wide = math.sqrt(rows / max(rows - (len(free) + point.starts.size) / point.starts.shape[0], 1))
    left = [
        _noise_alone(conditioning, rows_time(made), made.measured - run) * wide
        for made, run in zip(problem.experiments, simulated, strict=True)
    ]
    whole = _Whole(problem, point, simulated, left, noise, seed)
    found, failed = np.empty((draws, len(free))), 0
    for k, again in enumerate(_refits(whole, draws, report)):
        if again is None:
            failed += 1
        else:
            found[k - failed] = again[free]
    if failed > draws // 10:
        raise IdentifyError(
            f"{failed} of {draws} refits to redrawn data did not settle: the recordings do not hold these parameters; "
            "fix one with free = false, or excite the plant more"
        )
    return Redrawn(fit.free, found[: draws - failed], failed)


def left_over(fit: Fit, train: Sequence[Recording], conditioning: Conditioning) -> tuple[tuple[Array, Array], ...]:
    """Return, for each recording, the residuals (q, r) of a fit and its inputs (q, m) at the same instants.

    They are conditioned as the fit was, but for what colours noise: that would look like dynamics left over. Windows
    of one recording follow each other.
    """
    problem, point = _posed(fit, train, conditioning)
    pairs = []
    for each, start in zip(problem.experiments, point.starts, strict=True):
        made = plainly_conditioned(each)
        run = delayed(made, problem.engine.run(made.course, point.constants, start))
        time = rows_time(made)
        drive = made.course.drive[made.course.first : made.course.end]
        pairs.append(
            (made.target - conditioned(made, run), interpolate(time, drive, compared_time(made.conditioning, time)))
        )
    edges = np.cumsum([0, *problem.windows]).tolist()
    return tuple(
        (np.concatenate([e for e, _ in pairs[a:b]]), np.concatenate([u for _, u in pairs[a:b]]))
        for a, b in pairwise(edges)
    )


def _posed(fit: Fit, train: Sequence[Recording], conditioning: Conditioning) -> tuple[FitProblem, FitPoint]:
    """Pose the fit's problem again, at its solution."""
    parts = [experiments(fit.plant, recording, conditioning) for recording in train]
    lagged = [
        tuple(replace(made, lags=score.lags) for made in windows)
        for windows, score in zip(parts, fit.train, strict=True)
    ]
    problem = make_problem(fit.plant, simulator(fit.plant, train[0].hold), lagged)
    noise = np.array([fit.noise[signal.name] for signal in fit.plant.outputs])
    weights = 1.0 / np.where(noise > 0.0, noise, 1.0)
    starts = np.concatenate([score.starts for score in fit.train])
    return replace(problem, weights=weights), FitPoint(constants_of(fit.plant), starts)


class _Whole:
    """A problem at its solution, and the noise that is drawn around it, the same for the same number of a draw."""

    def __init__(
        self,
        problem: FitProblem,
        point: FitPoint,
        simulated: Sequence[Array],
        left: Sequence[Array],
        noise: Noise,
        seed: int,
    ) -> None:
        self.problem, self.point, self.noise, self.seed = problem, point, noise, seed
        self.simulated, self.left = simulated, left
        self.targets = [conditioned(made, run) for made, run in zip(problem.experiments, simulated, strict=True)]
        self.slopes = [slopes for _, slopes in weighted(problem, point)]
        self.place = coordinates(problem, point.constants)
        square = sum(_square(slopes[..., : len(self.place)]) for slopes in self.slopes)
        self.sizes = np.sqrt(np.diag(np.linalg.pinv(square)))

    def drawn(self, number: int) -> list[Array]:
        """Return what draw `number` adds to each conditioned simulation (q, r)."""
        random = np.random.default_rng((self.seed, number))
        return [
            conditioned(made, run + self.noise(rest, random)) - ours
            for made, run, rest, ours in zip(
                self.problem.experiments, self.simulated, self.left, self.targets, strict=True
            )
        ]

    def refit(self, added: Sequence[Array]) -> Array | None:
        """Fit whole simulations to a draw; its slopes at the solution are those of every draw."""
        drawn = tuple(
            replace(made, target=ours + more)
            for made, ours, more in zip(self.problem.experiments, self.targets, added, strict=True)
        )
        problem = replace(self.problem, experiments=drawn)
        first = [(more * problem.weights, slopes) for more, slopes in zip(added, self.slopes, strict=True)]

        def pairs(place: Array, starts: Array) -> list[Pair]:
            return list(weighted(problem, at_coordinates(problem, self.point.constants, place, starts)))

        return self.settled(first, pairs)

    def settled(self, first: Sequence[Pair], pairs: Callable[[Array, Array], list[Pair]]) -> Array | None:
        """Gauss-Newton from the solution of the true data; the constants where it settles, None where it does not."""
        problem, count = self.problem, len(self.problem.free)
        place, starts, held = self.place, self.point.starts, first
        for turn in range(MOST_STEPS):
            found = _inside(held, place, problem, starts.shape)
            if found is None:
                return None
            share = 1.0 if turn < WHOLE_STEPS else 0.5 ** (turn // WHOLE_STEPS)
            moved, length = found[0] * share, found[1] * share
            place = np.clip(place + moved[:count], problem.low, problem.high)
            starts = starts + moved[count:].reshape(starts.shape)
            if length < CLOSE:
                return at_coordinates(problem, self.point.constants, place, starts).constants
            held = pairs(place, starts)
        return None

    def distance(self, constants: Array) -> Array:
        """Return how far each free parameter (f,) is from the solution, in its standard deviations."""
        return np.asarray((coordinates(self.problem, constants) - self.place) / self.sizes)


def _refits(whole: _Whole, draws: int, report: Progress) -> Iterator[Array | None]:
    """Yield the constants of every draw: by the expansion where it can be trusted, else by whole simulations."""
    nearby = expand(whole.problem, whole.point, whole.place, whole.slopes)
    found: list[Array | None] = []
    for first in range(0, draws, SLOW):
        report(first / draws, f"{first} of {draws} draws")
        numbers = range(first, min(first + SLOW, draws))
        found += _nearby(whole, nearby, [whole.drawn(number) for number in numbers])
    reach = [math.inf if one is None else float(np.max(np.abs(whole.distance(one)))) for one in found]
    farthest = [int(number) for number in np.argsort(reach)[: -CHECKED - 1 : -1]]
    again = {number: whole.refit(whole.drawn(number)) for number in farthest}
    if all(_agree(whole, found[number], one) for number, one in again.items()):
        yield from found
        return
    for number in range(draws):
        if number % SLOW == 0:
            report(number / draws, f"{number} of {draws} draws, whole simulations")
        yield again[number] if number in again else whole.refit(whole.drawn(number))


def _agree(whole: _Whole, nearby: Array | None, exact: Array | None) -> bool:
    """Tell whether both fits of a draw settled at one place, or neither did."""
    if nearby is None or exact is None:
        return nearby is exact
    return bool(np.all(np.abs(whole.distance(nearby) - whole.distance(exact)) <= CLOSE))


def _nearby(whole: _Whole, nearby: Expansion, added: Sequence[Sequence[Array]]) -> list[Array | None]:
    """Fit the expansion to draws; what of their noise stands in it is found for all of them at once."""
    weights = whole.problem.weights
    seen = [
        np.stack([(more * weights).reshape(-1) for more in each]) @ one.basis
        for one, each in zip(nearby.experiments, zip(*added, strict=True), strict=True)
    ]
    made = []
    for parts in zip(*seen, strict=True):
        pairs = partial(nearby.pairs, parts)
        made.append(whole.settled(pairs(whole.place, whole.point.starts), pairs))
    return made


def _square(slopes: Array) -> Array:
    tall = slopes.reshape(-1, slopes.shape[2])
    return np.asarray(tall.T @ tall)


def _inside(
    pairs: Sequence[tuple[Array, Array]], place: Array, problem: FitProblem, starts: tuple[int, ...]
) -> tuple[Array, float] | None:
    """Return the step of all unknowns, those left where they are that stand at a bound and would go beyond it."""
    count = len(place)
    held = np.zeros(count, dtype=bool)
    for _ in range(count + 1):
        found = _step(pairs, held, starts)
        if found is None:
            return None
        goal = place + found[0][:count]
        beyond = ((place <= problem.low) & (goal < problem.low)) | ((place >= problem.high) & (goal > problem.high))
        if not np.any(beyond & ~held):
            break
        held = held | beyond
    return found


def _step(
    pairs: Sequence[tuple[Array, Array]], held: NDArray[np.bool_], starts: tuple[int, ...]
) -> tuple[Array, float] | None:
    """Return the step of the unknowns that are not `held`, and how far it moves the weighted residuals.

    A length of 1 is a standard deviation.
    """
    states, count = starts[1], len(held)
    size = count + starts[0] * states
    square, slope = np.zeros((size, size)), np.zeros(size)
    for k, (residual, slopes) in enumerate(pairs):
        tall = slopes.reshape(-1, slopes.shape[2])
        where = [*range(count), *range(count + k * states, count + (k + 1) * states)]
        square[np.ix_(where, where)] += tall.T @ tall
        slope[where] -= tall.T @ residual.reshape(-1)
    square[:count][held] = square[:, :count][:, held] = slope[:count][held] = 0.0
    if not (np.all(np.isfinite(square)) and np.all(np.isfinite(slope))):
        return None
    step, scaled = scaled_step(square, slope, DETERMINED)
    return step, float(np.max(np.abs(scaled)))


def _noise_alone(conditioning: Conditioning, time: Array, residual: Array) -> Array:
    """Take out of residuals (n, r) what cannot be drawn in pieces: a straight line, and lines that are filtered."""
    scale = np.linspace(-1.0, 1.0, len(residual))[:, None]
    left = residual - residual.mean(axis=0) - scale * (scale * residual).sum(axis=0) / np.sum(scale**2)
    return line_free(conditioning, time, left) if conditioning.line_Hz else np.asarray(left)
