"""An Experiment: one recording, or one window of it, made ready to be compared with a simulation of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.least_squares import descend, triangle
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import (
    NONE,
    Conditioning,
    check_conditioning,
    check_parts,
    condition_input,
    condition_output,
    find_lag,
    interpolate,
    uncoloured,
    windows,
)
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.at_rest import known_states
from firmloop.identify.simulation.course import Course, Engine
from firmloop.identify.simulation.simulate import course_of, measured

Array = NDArray[np.float64]

_FORGOTTEN = 1e-12  # of an output's spread per unit of an initial state
_STRETCHES = (1 / 64, 1 / 16, 1 / 4)  # of a recording, over which a fit of where it begins grows
_ROWS_PER_STATE = 4  # of a stretch: fewer tell next to nothing
_HELD = 1e-4  # of all slopes: a direction of the initial state that leaves next to no trace


@dataclass(frozen=True)
class Experiment:
    """What drives the simulation, and what its outputs are compared with after conditioning."""

    source: str
    course: Course
    measured: Array  # (n, r) as recorded
    target: Array  # (q, r) conditioned
    names: tuple[str, ...]  # of the r outputs
    conditioning: Conditioning
    lags: Mapping[str, float]  # s by which an output's clock is late
    known: tuple[int, ...] = ()  # states that are zero at its first row, see `known_states`
    unseen: int = 0  # rows at its begin that answer an input from before the recording alone

    @cached_property
    def spread(self) -> Array:
        """How far each output (r,) moves, 1 where it stands still; kept, for a fit asks some thousand times."""
        spread = np.std(self.target, axis=0)
        return np.where(spread > 0.0, spread, 1.0)


def experiments(plant: Plant, recording: Recording, conditioning: Conditioning) -> tuple[Experiment, ...]:
    """Take the plant's signals out of a recording; one experiment per window."""
    names = tuple(signal.name for signal in plant.outputs)
    inputs = tuple(signal.name for signal in plant.inputs)
    course = course_of(plant, recording)
    drive = np.column_stack([condition_input(conditioning, n, c) for n, c in zip(inputs, course.drive.T, strict=True)])
    if course.knots is not None:
        moments, lines = course.knots
        course = replace(course, knots=(moments, lines + (drive[0] - course.drive[0])))  # what it loses is a constant
    course = replace(course, drive=np.ascontiguousarray(drive))
    # A plant that remembers nothing answers in the first row an input that nobody has recorded.
    unseen = int(not plant.remembers and course.knots is None)
    values = measured(plant, recording)
    check_parts(conditioning, recording.source, course.time)
    made, known = [], known_states(plant, recording)
    for first, end in windows(conditioning, course.time, 2 * len(plant.states) + 2):
        check_conditioning(conditioning, (*inputs, *names), recording.source, course.time[first:end])
        part = values[first:end]
        bare = Experiment(
            recording.source, replace(course, first=first, end=end), part, part, names, conditioning, lags={}
        )
        own = replace(bare, known=() if first else known, unseen=0 if first else unseen)
        made.append(replace(own, target=conditioned(own, part)))
    return tuple(made)


def rows_time(made: Experiment) -> Array:
    """Return the time stamps (n,) in s of the experiment's own rows."""
    return made.course.time[made.course.first : made.course.end]


def conditioned(made: Experiment, outputs: Array) -> Array:
    """Condition values (n, r, ...) of all outputs, measured or simulated or a derivative, into (q, r, ...).

    Values of a million rows are long: where nothing is done to them they are returned as they are.
    """
    if made.conditioning == NONE and np.all(np.isfinite(outputs)):
        return np.ascontiguousarray(outputs)
    parts = [
        condition_output(made.conditioning, name, rows_time(made), outputs[:, index])
        for index, name in enumerate(made.names)
    ]
    if all(np.may_share_memory(part, outputs) for part in parts):
        return np.ascontiguousarray(outputs)
    return np.stack(parts, axis=1)


def plainly_conditioned(made: Experiment) -> Experiment:
    """Compare on the rows as recorded, where smoothing or a fine grid would give the noise a memory of its own."""
    plain = replace(made, conditioning=uncoloured(made.conditioning, rows_time(made)))
    return replace(plain, target=conditioned(plain, plain.measured))


def delayed(made: Experiment, outputs: Array) -> Array:
    """Show simulated values (n, r, ...), or slopes of them, by the late clock of each output.

    Of rows that lie before the simulation's begin or behind its end nothing is known: there they are as measured.
    """
    if not made.lags and not made.unseen:
        return outputs
    late, time = outputs.copy(), rows_time(made)
    known = made.measured if outputs.ndim == made.measured.ndim else np.broadcast_to(0.0, outputs.shape)
    for index, name in enumerate(made.names):
        if made.lags.get(name):
            moments = time - made.lags[name]
            late[:, index] = interpolate(time, outputs[:, index], moments)
            unknown = not_simulated(made, made.lags[name])
            late[unknown, index] = known[unknown, index]
    late[: made.unseen] = known[: made.unseen]
    return late


def not_simulated(made: Experiment, late: float) -> NDArray[np.bool_]:
    """Tell the rows (n,) for which a simulation that is shown `late` s later has no value."""
    moments, time = rows_time(made) - late, rows_time(made)
    return np.asarray((moments < time[0]) | (moments > time[-1]))


def aligned(parts: Sequence[Experiment], runs: Sequence[Array]) -> tuple[Experiment, ...]:
    """Find the clock difference of every output to be aligned, over all windows of one recording.

    `runs` are the simulated outputs (n, r) of each window.
    """
    time = np.concatenate([rows_time(made) for made in parts])
    real, ours = np.concatenate([made.measured for made in parts]), np.concatenate(list(runs))
    conditioning = parts[0].conditioning
    lags = {
        name: find_lag(time, real[:, index], ours[:, index], conditioning.align_max_lag_s)
        for index, name in enumerate(parts[0].names)
        if name in conditioning.align
    }
    return tuple(replace(made, lags=lags) for made in parts)


def misfit(
    made: Experiment, simulator: Engine, constants: Array, start: Array, which: Sequence[int]
) -> tuple[Array, Array]:
    """Residual measured - simulated (q, r) and its slopes (q, r, d) for constants[which] and the initial state.

    What has died out before it shows has none: a search would send it to where it shows, were it 1e80 away.
    """
    outputs, slopes = simulator.run_with_slopes(made.course, constants, start, which)
    residual = made.target - conditioned(made, delayed(made, outputs))
    slopes = conditioned(made, delayed(made, slopes))
    np.negative(slopes, out=slopes)
    own = slopes[..., len(which) :]
    for state in range(own.shape[2]):
        # One long column after another: over the first axis of all of them NumPy takes ten times as long.
        traces = [max(one.max(), -one.min()) / scale for one, scale in zip(own[..., state].T, made.spread, strict=True)]
        if np.max(traces) < _FORGOTTEN:
            own[..., state] = 0.0
    own[..., list(made.known)] = 0.0
    return residual, slopes


def missed(made: Experiment, simulator: Engine, constants: Array, start: Array, weights: Array) -> float:
    """Return the sum of squares of measured - simulated, outputs weighed by `weights` (r,); infinite if it diverges."""
    left = made.target - conditioned(made, delayed(made, simulator.run(made.course, constants, start)))
    power = float(np.sum((left * weights) ** 2))
    return power if np.isfinite(power) else np.inf


def best_start(made: Experiment, simulator: Engine, constants: Array, guess: Array, weights: Array) -> Array:
    """Fit the initial state (n,) alone, from `guess` and from where the plant usually is; weights (r,) are 1/noise.

    Exact after one step where the plant is linear. A direction of the state that leaves no trace stays as guessed,
    which is why a vessel that may not have been empty needs the second guess, and what dry friction holds at rest one
    that moves as far as the outputs do. What swings freely has another phase behind every swing that a guess is off:
    there a fit grows over the recording.
    """
    if not len(guess):  # a plant without memory
        return guess
    usual = simulator.usual_state(made.course, constants, guess)
    usual[list(made.known)] = guess[list(made.known)]
    guesses = [guess]
    if not np.array_equal(usual, guess):
        guesses += [usual, _over_stretches(made, simulator, constants, guess, weights)]
    small = _start_triangle(made, simulator, constants, guess, weights)
    if small is not None:
        pace = float(np.max(np.ptp(made.target, axis=0))) / (made.course.step * len(made.target))
        for held in set(simulator.sticking) - set(made.known):
            if np.linalg.norm(small[:, held]) < _HELD * np.linalg.norm(small[:, :-1]):
                guesses += [guess + sign * pace * (np.arange(len(guess)) == held) for sign in (1.0, -1.0)]

    found = [_descended(made, simulator, constants, each, weights) for each in guesses]
    return min(found, key=lambda each: each[0])[1]


def stretches(rows: int, states: int) -> list[int]:
    """Return the first rows of a recording, of which a fit of where it begins grows to all, the fewest first."""
    return [part for part in (int(share * rows) for share in _STRETCHES) if part > _ROWS_PER_STATE * states]


def _over_stretches(made: Experiment, simulator: Engine, constants: Array, guess: Array, weights: Array) -> Array:
    """Return the initial state (n,) that stretches from the first row on, each longer than the last, are met with."""
    for rows in stretches(len(made.measured), len(guess)):
        part = replace(made, course=replace(made.course, end=made.course.first + rows), measured=made.measured[:rows])
        part = replace(part, target=conditioned(part, part.measured))
        guess = _descended(part, simulator, constants, guess, weights)[1]
    return guess


def _descended(
    made: Experiment, simulator: Engine, constants: Array, guess: Array, weights: Array
) -> tuple[float, Array]:
    """Fit the initial state (n,) from one guess: (cost, place)."""

    def cost_at(start: Array) -> float:
        return missed(made, simulator, constants, start, weights)

    def reduced_at(start: Array) -> Array | None:
        return _start_triangle(made, simulator, constants, start, weights)

    return descend(cost_at, reduced_at, guess)


def _start_triangle(
    made: Experiment, simulator: Engine, constants: Array, start: Array, weights: Array
) -> Array | None:
    """Return the triangle of [slopes, residual] for the initial state; None where the simulation diverges."""
    residual, slopes = misfit(made, simulator, constants, start, ())
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
        return None
    tall = (slopes * weights[:, None]).reshape(-1, slopes.shape[2])
    return triangle(tall, (residual * weights).reshape(-1, 1))
