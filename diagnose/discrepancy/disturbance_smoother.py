"""Locate a mismatch: latent torque and voltage by a smoother, and the spans where the nominal plant fits worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.policy import MOST_SMOOTHED_ROWS, QUICK_WALK, SHORTEST_SPAN_S, WORST_SPANS
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.plants.per_recording import without_varying
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.linear_filter import recurred
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import course_of, measured

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Latent:
    """Smoothed states (n, s) of the nominal plant and the disturbance (n,) of each balance that explains the rest.

    `kinds` are those of the balances; a disturbance is in N m, N, V or the flow's unit, positive where it drives.
    """

    time: Array
    states: Array
    disturbances: tuple[Array, ...]
    kinds: tuple[str, ...]


def nominal_plant(search: Search, candidate: Candidate) -> Plant:
    """Return the plant without effects, with the nominal parameters of an explanation."""
    return without_varying(search.problem.plant.valued(candidate.fitted.point.values))


def as_others(search: Search, recording: Recording, values: Mapping[str, float], start: Array) -> Recording:
    """Return the recording without what its own load, zero and the like, which its initial state holds, do to it."""
    plant, engine = search.problem.plant, search.problem.engine
    if not plant.varying:
        return recording
    common = start.copy()
    common[[one.state for one in plant.varying]] = 0.0
    own = np.nan_to_num(engine.simulate(recording, values, start) - engine.simulate(recording, values, common))
    outputs = {signal.name: recording.columns[signal.name] - own[:, k] for k, signal in enumerate(plant.outputs)}
    return replace(recording, columns={**recording.columns, **outputs})


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


def latent(plant: Plant, recording: Recording, noise: Sequence[float]) -> Latent | None:
    """Smooth the nominal plant with a random-walk disturbance in every balance that the outputs can tell.

    `noise` (r,) is the rms of each output. None where the equations do not allow a smoother, or it diverges.
    """
    balances = [each for each in plant.balances if each.state >= 0][: len(plant.outputs)]
    course = course_of(plant, recording)
    made = tracker(plant, balances, course.step, noise, [QUICK_WALK] * len(balances))
    if made is None:
        return None
    drive = course.drive[:MOST_SMOOTHED_ROWS]
    rows, states = len(drive), len(plant.states)
    outputs = measured(plant, recording)[:rows]
    start = np.zeros(len(made.step))
    start[:states] = np.linalg.lstsq(made.reading[:, :states], outputs[0], rcond=None)[0]
    with np.errstate(over="ignore", invalid="ignore"):  # of bodies that hardly tell them apart it may diverge
        here = made.smoothed(outputs, drive @ made.push.T, start)
    if not np.all(np.isfinite(here)):
        return None
    kinds = tuple(balance.kind for balance in balances)
    disturbances = tuple(here[:, states + k] for k in range(len(balances)))
    return Latent(course.time[:rows], here[:, :states], disturbances, kinds)


def worst_spans(search: Search, noises: Sequence[Noise]) -> tuple[str, tuple[tuple[float, float], ...], float]:
    """Return the output that fits worst, the spans (s) of the first train recording where, and their rms over noise.

    `noises` are of what nothing is missing from, one an output.
    """
    problem, nominal = search.problem, search.nominal
    left = nominal.fitted.residuals[0]
    each = np.column_stack([noise.whiten(left[:, k]) for k, noise in enumerate(noises)])
    for k, noise in enumerate(noises):
        each[: len(noise.coefficients), k] = 0.0  # no past to whiten by
    worst = int(np.argmax(np.sum(each**2, axis=0)))
    time = problem.train[0].time
    step = float(np.median(np.diff(time)))
    width = max(int(SHORTEST_SPAN_S / step), 3)
    power = scipy.ndimage.uniform_filter1d(each[:, worst] ** 2, width)
    spans: list[tuple[float, float]] = []
    open_power = power.copy()
    level = 0.3 * float(np.max(power))
    for _ in range(WORST_SPANS):
        peak = int(np.argmax(open_power))
        if open_power[peak] <= max(level, 0.0):
            break
        low = high = peak
        while low > 0 and open_power[low - 1] > 0.5 * power[peak]:
            low -= 1
        while high + 1 < len(power) and open_power[high + 1] > 0.5 * power[peak]:
            high += 1
        spans.append((float(time[low]), float(time[high])))
        open_power[max(low - width, 0) : high + width] = 0.0
    return problem.plant.outputs[worst].name, tuple(sorted(spans)), float(np.sqrt(np.max(power)))
