"""Follow a plant that something beside its input drives: where that moves outputs, and how likely it makes them.

A disturbance is a random walk in a balance, read through white noise of the sensors: a stationary Kalman filter. Its
innovations weigh it against the other way to explain what a fit leaves: sensors whose own noise has a memory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.model.fit import Fitted, noises_of
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.policy import MOST_WEIGHED_ROWS, WALKS
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.per_recording import without_varying
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.linear_filter import recurred
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import course_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tracker:
    """A stationary Kalman filter of states and disturbances (s + b,), and the smoother that belongs to it."""

    step: Array  # (s + b, s + b) from row to row
    push: Array  # (s + b, m) by the inputs
    reading: Array  # (r, s + b)
    kalman: Array
    back: Array
    innovation: Array  # (r, r)

    def begin(self, outputs: Array) -> tuple[Array, Array]:
        """Return where outputs (n, r) most likely begin (s + b,), which nobody knows, and the innovations (n, r).

        They are linear in where it begins: a motion that was under way would else be a disturbance at its first rows.
        """
        rows, size = len(outputs), len(self.step)
        ahead, _ = self.filtered(outputs, np.zeros((rows, size)), np.zeros(size))
        left = outputs - ahead @ self.reading.T
        seen = recurred(self.forgets.T, np.zeros((rows - 1, *self.reading.shape)), self.reading)
        root = np.linalg.inv(np.linalg.cholesky(self.innovation))
        start = np.linalg.lstsq((root @ seen).reshape(-1, size), (left @ root.T).ravel(), rcond=None)[0]
        return np.asarray(start), np.asarray(left - seen @ start)

    @property
    def forgets(self) -> Array:
        """What a row leaves of an error in the state before it (s + b, s + b)."""
        return np.asarray(self.step @ (np.eye(len(self.step)) - self.kalman @ self.reading))

    def filtered(self, outputs: Array, forced: Array, start: Array) -> tuple[Array, Array]:
        """Return states and disturbances (n, s + b) before each row of outputs (n, r) is read, and after.

        The reading of row k comes before input k acts; a direct path is not corrected for.
        """
        pushes = outputs @ (self.step @ self.kalman).T + forced
        ahead = recurred(self.forgets, pushes[:-1], start)
        return ahead, np.asarray(ahead + (outputs - ahead @ self.reading.T) @ self.kalman.T)

    def smoothed(self, outputs: Array, forced: Array, start: Array) -> Array:
        """Return states and disturbances (n, s + b) by all rows of outputs (n, r)."""
        ahead, here = self.filtered(outputs, forced, start)
        pushes = here[:-1] - ahead[1:] @ self.back.T
        return recurred(self.back, pushes[::-1], here[-1])[::-1]


def tracker(
    plant: Plant, balances: Sequence[Balance], step_s: float, noise: Sequence[float], walks: Sequence[float]
) -> Tracker | None:
    """Follow the nominal plant with a random walk in each of these balances.

    `noise` (r,) is the rms of each output, and `walks` (b,) the shares of it that a step of each disturbance does to
    the output that shows it most. None where the equations do not allow one.
    """
    bare = linearize(plant)
    if not balances or not all(np.all(np.isfinite(part)) for part in (bare.a, bare.b, bare.c)):
        return None
    constants = np.array([p.value for p in plant.parameters])[: plant.rate.numel_in(2)]
    states, extra, inputs = len(plant.states), len(balances), bare.b.shape[1]
    size = states + extra
    whole = np.zeros((size + inputs, size + inputs))
    whole[:states, :states] = bare.a
    for index, balance in enumerate(balances):
        whole[balance.state, states + index] = float(balance.per(constants))
    whole[:states, size:] = bare.b
    moved = scipy.linalg.expm(whole * step_s)
    step, push = moved[:size, :size], moved[:size, size:]
    reading = np.concatenate([bare.c, np.zeros((len(bare.c), extra))], axis=1)
    spread = np.array([max(float(size), 1e-12) for size in noise])
    steps = np.zeros(size)
    gain = np.abs(reading @ step[:, states:]) / spread[:, None]
    reach = np.maximum(np.max(gain, axis=0), 1e-30)
    steps[states:] = np.array(walks) / reach
    covariance = np.diag(np.maximum(steps**2, 1e-18 * np.max(steps**2)))
    try:
        predicted = scipy.linalg.solve_discrete_are(step.T, reading.T, covariance, np.diag(spread**2))
        innovation = reading @ predicted @ reading.T + np.diag(spread**2)
        kalman = predicted @ reading.T @ np.linalg.inv(innovation)
        filtered = predicted - kalman @ reading @ predicted
        back = filtered @ step.T @ np.linalg.inv(predicted)
    except (np.linalg.LinAlgError, ValueError):
        return None
    return Tracker(step, push, reading, kalman, back, innovation)


class Disturbed(NamedTuple):
    """A tracker of each recording, none where there is none, and -2 log likelihood of what it followed by its price.

    By BIC, the size of the sensors' white noise free, and but for a constant.
    """

    trackers: list[Tracker]
    unlikely: float


def followed(
    plant: Plant,
    balances: Sequence[Balance],
    recordings: Sequence[Recording],
    residuals: Sequence[Array],
    noise: Sequence[float],
    most: int = MOST_WEIGHED_ROWS,
) -> Disturbed:
    """Follow residuals (n, r) by disturbances of these balances, that move as quickly as makes them likeliest.

    `noise` (r,) is the rms of each sensor's own; `most` rows of all recordings are weighed.
    """
    told = [part[: _told(recordings, most)] for part in residuals]
    by = partial(_by, plant, balances, recordings, told, noise)
    best, walks = _likeliest(by, [[walk] * len(balances) for walk in WALKS])
    for index in range(len(balances) if len(balances) > 1 else 0):
        best, walks = _likeliest(by, [[*walks[:index], walk, *walks[index + 1 :]] for walk in WALKS])
    return best


def _likeliest(
    by: Callable[[Sequence[float]], Disturbed], every: Sequence[list[float]]
) -> tuple[Disturbed, list[float]]:
    """Return what follows by the likeliest of some walks, and those walks."""
    return min(((by(walks), walks) for walks in every), key=lambda pair: pair[0].unlikely)


def groups(plant: Plant) -> list[list[Balance]]:
    """Return the balances that are followed together: all that outputs can tell apart, or else each alone."""
    balances = [each for each in plant.balances if each.state >= 0]
    return [balances] if len(balances) <= len(plant.outputs) else [[each] for each in balances]


def sensors_remember(problem: Problem, values: Mapping[str, float], residuals: Sequence[Array]) -> bool:
    """Tell whether what is left is likelier noise of sensors with a memory than a machine that is disturbed.

    `residuals` (n, r) of each train recording are what `values` of the parameters leave. The memory is that of a filter
    of first order: one of many coefficients would follow the machine as well.
    """
    if not all(np.all(np.isfinite(part)) for part in residuals):
        return False
    machine = _machine(problem, values, residuals, MOST_WEIGHED_ROWS)
    told = [part[: _told(problem.train, MOST_WEIGHED_ROWS)] for part in residuals]
    rows = sum(map(len, told))
    sensors = sum(each.unlikely(rows) for each in noises_of(problem, told, (0, 1)))
    return sensors < machine < np.inf


def driven_evidence(problem: Problem, fitted: Fitted) -> float:
    """Return -2 log likelihood and the price by BIC of a fit to a machine that something beside its input may drive.

    By the likelier of two kinds of noise: readings with a memory of their own, or a random force in a balance, which
    moves a position far and makes by chance what no noise of readings would.
    """
    left = fitted.residuals
    rows = sum(map(len, left))
    machine = _machine(problem, fitted.point.values, left, len(left) * max(map(len, left)))
    sensors = sum(each.unlikely(rows) for each in noises_of(problem, left))
    return min(sensors, machine) + len(fitted.coordinates) * float(np.log(rows))


def _machine(problem: Problem, values: Mapping[str, float], residuals: Sequence[Array], most: int) -> float:
    """Return -2 log likelihood and its price of residuals (n, r) of a disturbed machine; infinite where none is.

    `values` are the parameters that leave them, `most` the rows of all recordings that are weighed.
    """
    plant = with_effects(without_varying(problem.plant.valued(values)), ())
    noise = sensor_noises(residuals, problem.floors)
    every = [followed(plant, some, problem.train, residuals, noise, most) for some in groups(plant) if some]
    return min((each.unlikely for each in every), default=np.inf)


def _told(recordings: Sequence[Recording], most: int) -> int:
    """Return how many rows of each recording are weighed, where `most` are of all."""
    return max(most // len(recordings), 1)


def _by(
    plant: Plant,
    balances: Sequence[Balance],
    recordings: Sequence[Recording],
    residuals: Sequence[Array],
    noise: Sequence[float],
    walks: Sequence[float],
) -> Disturbed:
    """Follow residuals by disturbances that move so quickly; infinitely unlikely where no tracker is steady."""
    steps = [course_of(plant, each).step for each in recordings]
    made = {step: tracker(plant, balances, step, noise, walks) for step in dict.fromkeys(steps)}
    trackers = [each for each in map(made.__getitem__, steps) if each is not None and _steady(each)]
    if len(trackers) < len(recordings):
        return Disturbed([], np.inf)
    size, power, rows = 0.0, 0.0, 0
    for each, left in zip(trackers, residuals, strict=True):
        innovations = each.begin(left)[1]
        size += len(innovations) * float(np.linalg.slogdet(each.innovation)[1])
        power += float(np.sum(innovations * np.linalg.solve(each.innovation, innovations.T).T))
        rows += len(innovations)
    count = rows * len(noise)
    price = (len(walks) + 1) * np.log(rows)
    return Disturbed(trackers, size + count * float(np.log(max(power / count, 1e-300))) + float(price))


def _steady(each: Tracker) -> bool:
    """Tell whether neither filter nor smoother runs away: where a walk is next to none, rounding may do that."""
    return all(np.max(np.abs(np.linalg.eigvals(part))) < 1.0 for part in (each.forgets, each.back))
