"""Refuse recordings that are too short, or too still, for the model that is asked of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.experiment import Experiment
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.recordings.stillness import moves
from firmloop.identify.simulation.linearize import linearize

Array = NDArray[np.float64]

_BY_PARAMETER = 5  # readings: fewer, and an interval rests on a guess of the noise
_BY_STATE = 2  # readings for each initial state, of which every window has its own
_SETTLED = 3.0  # time constants: within 5 % of the final value
_DRIFTS = 100.0  # recordings: a time constant as long as that is none
_STEP = 1e-5  # of a parameter, over which a time constant is seen to follow it
_OTHERWISE = (
    "something else moves it, or it answers in another way than this kind does (by a curve, or bound to where it "
    "stands, as an arm in gravity), or it rests at another level than 0; plot it over the input, take a plant.kind "
    "with that physics, give output_at_rest, or record what else drives it"
)
_NOISE_FREE = 1e-6  # of a state's largest slope: a pole of zero and what rounding makes of it


def check_moving(recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where an output of a recording stands still that should move, see `dead_outputs`."""
    readings = [np.concatenate([made.target for made in windows]) for windows in recordings]
    drives = [np.concatenate([made.course.drive for made in windows]) for windows in recordings]
    for k, column in dead_outputs(readings, drives):
        first = recordings[k][0]
        name = f"column {first.names[column]}"
        driven = np.any(np.ptp(drives[k], axis=0))
        what = f"{name} never changes" if driven else f"neither an input nor {name} ever changes"
        raise IdentifyError(f"{first.source}: {what}; record the plant while it moves")


def dead_outputs(readings: Sequence[Array], drives: Sequence[Array]) -> list[tuple[int, int]]:
    """Return which recordings (n, r) hold an output that stands still throughout, as (recording, output).

    Not where nothing drives it, or friction or a dead zone may hold it: it moves in other recordings, and each of those
    is driven further.
    """
    still = np.array([np.ptp(each, axis=0) == 0.0 for each in readings])
    reach = np.array([np.max(np.abs(each), axis=0) for each in drives])
    found = []
    for k, column in np.argwhere(still):
        moving = reach[~still[:, column]]
        if len(moving) == 0 or (np.any(reach[k]) and not np.all(np.any(moving > reach[k], axis=1))):
            found.append((int(k), int(column)))
    return found


def check_rows(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where there are too few readings for the unknowns."""
    parts = [made for windows in recordings for made in windows]
    free, states = sum(parameter.free for parameter in plant.parameters), len(plant.states) * len(parts)
    outputs = len(plant.outputs)
    rows = sum(len(made.target) for made in parts)
    needed = -(-(_BY_PARAMETER * free + _BY_STATE * states) // outputs)
    if rows < needed:
        sources = ", ".join(dict.fromkeys(made.source for made in parts))
        raise IdentifyError(
            f"{sources}: {rows} rows are too few for {plant.kind}: {free} free parameters and {states} initial states "
            f"need at least {needed} rows of {outputs} output{'s' if outputs > 1 else ''} ({_BY_PARAMETER} readings "
            f"for each parameter, {_BY_STATE} for each state); record longer, or fix parameters with free = false"
        )


def check_span(
    plant: Plant, free: Sequence[str], covariance: Array, recordings: Sequence[Sequence[Experiment]]
) -> None:
    """Raise IdentifyError where a gain is wanted and the recordings surely end before the fitted plant can show it.

    Where the interval of the slowest time constant holds the length of the recording, its value says nothing of how
    long to record, and what the fit says of its intervals stands alone. `covariance` is that of the `free` parameters;
    NaN of a fit whose intervals mean nothing.
    """
    slowest = outlasting(plant, recordings)
    if slowest is None:
        return
    longest, span = _longest(recordings)
    if not any(moves(made.target) for windows in recordings for made in windows):
        raise IdentifyError(f"{longest.source}: {_only_noise(plant)}")
    if slowest > _DRIFTS * span:
        raise IdentifyError(
            f"{longest.source}: the output drifts and does not settle within its {span:.3g} s, so "
            f"that {plant.kind} has no gain; take the drift out with [recordings.conditioning] detrend, record longer, "
            "or fix gain with free = false"
        )
    if span < slowest * math.exp(-NORMAL_95 * _doubt_of_slowest(plant, free, covariance, slowest)):
        raise IdentifyError(
            f"{longest.source}: {span:.3g} s are too short for {plant.kind}: its slowest time "
            f"constant comes out as {slowest:.2g} s, so that its gain lies beyond what was recorded; record at least "
            f"{_SETTLED * slowest:.2g} s ({_SETTLED:.0f} time constants), or fix gain with free = false"
        )


def outlasting(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> float | None:
    """Return the slowest time constant of a plant, s, where its gain is wanted and no recording is as long; else None.

    Where some of the dynamics are given, what was asked may be a ratio of the gain and those: a mass, say.
    """
    if not all(parameter.free for parameter in plant.parameters if parameter.name != "delay_s"):
        return None
    if not any(parameter.name == "gain" for parameter in plant.parameters):
        return None
    slowest = _slowest(plant)
    return slowest if slowest is not None and slowest > _longest(recordings)[1] else None


def _longest(recordings: Sequence[Sequence[Experiment]]) -> tuple[Experiment, float]:
    """Return the longest window of all recordings, and how long it is, s."""
    parts = [made for windows in recordings for made in windows]
    spans = [float(made.course.time[made.course.end - 1] - made.course.time[made.course.first]) for made in parts]
    longest = int(np.argmax(spans))
    return parts[longest], spans[longest]


def _slowest(plant: Plant) -> float | None:
    """Return the slowest time constant of a plant, s; None where one of its states does not decay, or it has none."""
    poles = np.linalg.eigvals(linearize(plant).a)
    poles = poles[np.abs(poles) > _NOISE_FREE * np.max(np.abs(poles), initial=0.0)]
    decays = -np.real(poles)
    return 1.0 / float(np.min(decays)) if len(decays) and np.min(decays) > 0.0 else None


def _doubt_of_slowest(plant: Plant, free: Sequence[str], covariance: Array, slowest: float) -> float:
    """Return the standard deviation of the natural logarithm of the slowest time constant; inf where it has none."""
    values, slopes = {parameter.name: parameter.value for parameter in plant.parameters}, np.zeros(len(free))
    for k, name in enumerate(free):
        step = _STEP * (abs(values[name]) or 1.0)
        moved = _slowest(plant.valued({name: values[name] + step}))
        slopes[k] = (math.log(moved / slowest)) / step if moved is not None else math.nan
    by = np.flatnonzero(slopes)
    variance = float(slopes[by] @ covariance[np.ix_(by, by)] @ slopes[by])
    return math.sqrt(max(variance, 0.0)) if math.isfinite(variance) else math.inf


def check_delay(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where a delay is given that is no shorter than every recording."""
    given = next((each for each in plant.parameters if each.name == plant.delay), None)
    longest, span = _longest(recordings)
    if given is not None and given.value >= span:
        raise IdentifyError(
            f"{longest.source}: {given.name} is given as {given.value:.4g} s and the recording lasts {span:.4g} s, so "
            f"that nothing of {plant.inputs[0].name} arrives within it; correct {given.name} in [plant.parameters], "
            "which is in seconds, or leave it out to have it found"
        )


def check_step(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where no input ever changes, and a gain is asked for, or nothing but white noise is read."""
    parts = [made for windows in recordings for made in windows]
    drive = np.concatenate([made.course.drive for made in parts])
    if np.any(np.ptp(drive, axis=0) > 0.0):
        return
    if not np.any(drive) and any(parameter.name == "gain" and parameter.free for parameter in plant.parameters):
        raise IdentifyError(
            f"{parts[0].source}: the input is zero in every row, which tells no gain; record the plant while it is "
            "driven, or fix gain with free = false"
        )
    if any(moves(made.target) for made in parts):
        return
    raise IdentifyError(
        f"{parts[0].source}: the step never comes: {_held_input(plant, drive)} in every row, and "
        f"{', '.join(parts[0].names)} show{'s' if len(parts[0].names) == 1 else ''} nothing but noise; record the "
        "plant while its input changes"
    )


def check_follows(plant: Plant, explained: float, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where a fit that follows an output poorly has run away to a time constant beyond all rows.

    That is no drift of the output: the kind has found nothing to follow. `explained` is the share of its variance.
    """
    slowest = outlasting(plant, recordings)
    longest, span = _longest(recordings)
    if slowest is not None and slowest > _DRIFTS * span:
        raise IdentifyError(
            f"{longest.source}: {_misses(plant, explained)}, and its time constant runs away to {slowest:.2g} s beside "
            f"{span:.3g} s of recording: {_OTHERWISE}"
        )


def _only_noise(plant: Plant) -> str:
    return (
        f"{plant.outputs[0].name} shows nothing but noise while {plant.inputs[0].name} changes; check the wiring, "
        "drive the plant further, or record longer if it answers that late"
    )


def _misses(plant: Plant, explained: float) -> str:
    return f"{plant.kind} explains only {100.0 * max(explained, 0.0):.2g} % of {plant.outputs[0].name}"


def check_answer(
    plant: Plant, gain: Parameter, explained: float, slow: bool, recordings: Sequence[Sequence[Experiment]]
) -> None:
    """Raise IdentifyError where the 95 % interval of a fitted gain holds 0: the output does not answer the input.

    `explained` is the share of the output's variance that is explained; `slow`, that what is left is no white noise.
    """
    interval = gain.interval_95
    if interval is None or not gain.may_be_zero:
        return
    parts = [made for windows in recordings for made in windows]
    where = f"{', '.join(dict.fromkeys(made.source for made in parts))}: "
    drive = np.concatenate([made.course.drive for made in parts])
    if not np.any(np.ptp(drive, axis=0)):
        raise IdentifyError(
            f"{where}{_held_input(plant, drive)} in every row, so that gain cannot be told from what "
            f"{plant.outputs[0].name} does by itself; record the plant while its input changes, or fix gain with "
            "free = false"
        )
    told = f"{where}gain cannot be told from 0 (95 % interval {interval[0]:.2g} to {interval[1]:.2g})"
    if not any(moves(made.target) for made in parts):
        raise IdentifyError(f"{told}: {_only_noise(plant)}")
    if all(np.all(np.diff(made.course.drive[:, 0]) >= 0.0) for made in parts):
        raise IdentifyError(
            f"{told}: {plant.inputs[0].name} only rises, and beside what a {plant.kind} leaves of "
            f"{plant.outputs[0].name} a drift would do as much; record it going up and down, several times, or cut the "
            "recording to where the two go together"
        )
    if slow:
        raise IdentifyError(
            f"{told}: {_misses(plant, explained)}, and what is left moves slowly, as noise of a sensor does not: "
            f"{_OTHERWISE}"
        )
    raise IdentifyError(
        f"{told}: as a {plant.kind}, {plant.outputs[0].name} does not answer {plant.inputs[0].name}, or the recording "
        "does not hold what the kind needs; check the wiring, excite the plant more, or choose another kind"
    )


def _held_input(plant: Plant, drive: Array) -> str:
    """Say at what the inputs (n, m) stand throughout."""
    return ", ".join(f"{one.name} is {value:g}" for one, value in zip(plant.inputs, drive[0], strict=True))
