"""Which initial states are known, as a recording begins at rest: undriven it stands, or it is a step from there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.operating_point import OUTPUT
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.recordings.stillness import FEWEST, driven, resting
from firmloop.identify.simulation.linearize import Linear, linearize
from firmloop.identify.simulation.simulate import constants_of, drive_of, measured, seen_places

Array = NDArray[np.float64]

_SEEN = 0.01  # of an output's range: an initial state that moves it by less, or by less than its noise, is known
_VAGUE = 1e-6  # of what an initial state does to the outputs: what is known of it without any row
_MOMENTS = 60  # of a recording, at which that is looked at
_SAME_REST = 0.03  # of an output's range, within which two recordings begin at the same rest
_STANDING = 5  # rows for which a step that begins with its recording keeps its input


def known_states(plant: Plant, recording: Recording) -> tuple[int, ...]:
    """Return the states of the plant without effects that a recording begins with at rest, as far as its rows tell.

    Before anything drives, readings that stand still leave no initial state but those that hold every output where it
    is, such as a position. How well they tell the others follows from the plant, linear, with levels of the outputs
    unknown; one whose doubt would never move an output by more than its noise, or a hundredth of its range, is known to
    be zero.
    """
    drive, outputs = drive_of(plant, recording), measured(plant, recording)
    rest = resting(outputs, drive, np.max(np.abs(drive), axis=0))
    bare = _undelayed(with_effects(plant, ()))
    begins = recording.from_rest or 0 < len(rest) < len(drive) or switched_on(plant, recording)
    line = _at_zero(bare) if begins else None
    if line is None:
        return ()
    told_otherwise = {*(one.state for one in plant.varying), *(state for state, _ in seen_places(plant))}
    if recording.from_rest:
        return tuple(k for k in range(len(bare.states)) if k not in told_otherwise)
    if not len(rest):
        read = {int(np.argmax(row)) for row in line.c if np.count_nonzero(row) == 1}
        return tuple(k for k in range(len(bare.states)) if k not in told_otherwise | read)
    span, time = np.ptp(outputs, axis=0), recording.time - recording.time[0]
    noise = _noise(rest, outputs)
    seen = line.c / np.maximum(_SEEN * span, noise)[:, None]
    moments = np.geomspace(time[1], time[-1], _MOMENTS)
    far = seen @ scipy.linalg.expm(line.a * moments[:, None, None])
    reach = np.max(np.sum(far**2, axis=1), axis=0)
    step = scipy.linalg.expm(line.a * (time[len(rest) - 1] / (len(rest) - 1)))
    traces = [line.c / noise[:, None]]
    for _ in rest[1:]:
        traces.append(traces[-1] @ step)
    told = np.stack(traces)  # (rows, r, n)
    told = (told - told.mean(axis=0)).reshape(-1, len(line.a))
    shown = np.flatnonzero(np.isfinite(reach) & (reach > 0.0))
    scale = np.sqrt(reach[shown])
    scaled = told[:, shown] / scale
    doubt = np.diag(np.linalg.inv(scaled.T @ scaled + _VAGUE * np.eye(len(shown))))
    return tuple(int(k) for k, size in zip(shown, doubt, strict=True) if size <= 1.0 and k not in told_otherwise)


def switched_on(plant: Plant, recording: Recording) -> bool:
    """Tell whether a recording begins with a step from rest: its input is on and stands, its readings rest.

    A position that is read tells nothing of it: it may stand anywhere, or pass by.
    """
    drive, outputs = drive_of(plant, recording), measured(plant, recording)
    if not np.any(drive[0]) or np.any(np.ptp(drive[:_STANDING], axis=0)):
        return False
    places = {column for _, column in seen_places(plant)}
    bare = with_effects(plant, ())
    values = [each.value for each in bare.parameters[: bare.reading.numel_in(2)]]
    rests = bare.reading(np.zeros(len(bare.states)), np.zeros(len(bare.inputs)), values)
    span, away = np.ptp(outputs, axis=0), outputs[0] - np.asarray(rests, dtype=np.float64).ravel()
    tells = (span > 0.0) & np.array([signal.name not in places for signal in plant.outputs])
    return bool(np.any(tells) and np.all(np.abs(away[tells]) <= _SEEN * span[tells]))


def begun_at_rest(plant: Plant, recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return recordings of a plant whose level of rest is free with those marked that are one step from rest.

    Such a recording alone tells that level from the gain only by where it begins, and the one row or two before its
    step, over which nothing moves far, would leave both to what a plant of too few lags misses. So it is taken to begin
    at rest, unless its readings move before the step, or several such begin at different readings.
    """
    if plant.varying or not any(each.name == OUTPUT and each.free for each in plant.parameters):
        return tuple(recordings)
    steps = [_one_step(plant, each) for each in recordings]
    outputs = [measured(plant, each) for each in recordings]
    begun = [each[0] for each, one in zip(outputs, steps, strict=True) if one]
    spans = [np.ptp(each, axis=0) for each in outputs]
    if not begun or np.any(np.ptp(begun, axis=0) > _SAME_REST * np.max(spans, axis=0)):
        return tuple(recordings)
    return tuple(replace(each, from_rest=one) for each, one in zip(recordings, steps, strict=True))


def _one_step(plant: Plant, recording: Recording) -> bool:
    """Tell whether an input of a recording that begins undriven stands at one level from its first change on."""
    drive, outputs = drive_of(plant, recording) - plant.resting_input, measured(plant, recording)
    most = np.max(np.abs(drive), axis=0)
    acts = driven(drive, most)
    first = int(np.argmax(acts))
    stands = first > 0 and bool(np.all(np.ptp(drive[first:], axis=0) <= _SEEN * most))
    return stands and (first < FEWEST or len(resting(outputs, drive, most)) > 0)


def _undelayed(plant: Plant) -> Plant:
    """Return a plant whose input, of which there is none yet, comes at once: a fit may not have found its delay."""
    return replace(
        plant,
        parameters=tuple(replace(each, value=0.0) if each.name == plant.delay else each for each in plant.parameters),
    )


def _at_zero(bare: Plant) -> Linear | None:
    """Linearize a plant with neither state nor input; None where it does not stay there, or has no slopes there."""
    if not bare.states or any(math.isnan(parameter.value) for parameter in bare.parameters):
        return None
    line = linearize(bare)
    rates = np.array(bare.rate(np.zeros(len(bare.states)), np.zeros(len(bare.inputs)), constants_of(bare)))
    return line if not np.any(rates) and np.all(np.isfinite(line.a)) and np.all(np.isfinite(line.c)) else None


def _noise(rest: Array, outputs: Array) -> Array:
    """Return the noise (r,) of readings that rest, no less than the rounding that all readings have."""
    steps = np.abs(np.diff(outputs, axis=0))
    least = [float(np.min(column[column > 0.0], initial=np.inf)) for column in steps.T]
    grid = np.where(np.isfinite(least), least, 1.0) / np.sqrt(12.0)
    return np.asarray(np.maximum(np.std(rest, axis=0), grid))
