"""Unroll readings that wrap around like an overflowing counter, and read their range off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.quantization import Direct
from firmloop.diagnose.data.viterbi import cheapest
from firmloop.diagnose.policy import (
    AT_RIM,
    CLOSER_RMS,
    FARTHEST_LEAP,
    FEWEST_LEAPS,
    FEWEST_LEVELS,
    GIVEN_DEVIATION,
    LASTING_LEAP,
    LEAP,
    LEAP_EITHER_WAY,
    LEAP_GAINS,
    MET_LEAPS,
    MOST_TURNS_OFF,
    RANGE_BATCHES,
    RANGE_DEVIATIONS,
    RANGE_DIFFERENCE_STEP,
    RANGE_NEAR_SPAN,
    RANGE_REFINED,
    RIM,
    SEEN_SHARES,
    TELLING_WRAP,
    WHOLE_RANGE,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.effects import effect_seen_by
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.recordings.wrapping import JUMP, UNLIKE, wrapping
from firmloop.identify.simulation.simulate import measured, simulate

Array = NDArray[np.float64]


def unwrapped(
    plant: Plant, train: Sequence[Recording], test: Sequence[Recording]
) -> tuple[tuple[Recording, ...], tuple[Recording, ...], tuple[Direct, ...]]:
    """Return the recordings with every reading that wraps unrolled, and what was found."""
    found = []
    for signal in plant.outputs:
        columns = [recording.columns[signal.name] for recording in train]
        if len(np.unique(np.concatenate(columns))) < FEWEST_LEVELS or _limited(signal.name, columns):
            continue
        undo: Callable[[Plant, Recording, str, float], Recording] = _unrolled
        wrap = wrapping(columns)
        if wrap is None:
            expected = [_expected(plant, recording, signal.name) for recording in train]
            undo, wrap = _unfolded, _folded(columns, expected)
            if wrap is None:
                wrap, gain = _leaping(columns, expected)
                undo = partial(_unrolled, gain=gain)
        if wrap is None:
            continue
        moved = [undo(plant, recording, signal.name, wrap[0]) for recording in (*train, *test)]
        turns = [
            turns_between(before, after, signal.name, wrap[0])
            for before, after in zip((*train, *test), moved, strict=True)
        ]
        reach, deviation, left = _refined(plant, moved[: len(train)], signal.name, turns[: len(train)], wrap[0])
        off = abs(reach - wrap[0])
        # A sensor that shows only a part of its turn jumps by less than a turn: simulations tell by how much.
        if (off > RANGE_DEVIATIONS * wrap[2] or deviation > wrap[2]) and not (left < CLOSER_RMS and off > deviation):
            reach, deviation = wrap[0], wrap[2]  # what else is hidden has bent the fit, or the jumps tell more
        if reach < SEEN_SHARES[0] * float(np.ptp(np.concatenate(columns))):
            continue  # no reading of it could lie where readings do
        low = wrap[1]
        whole = [shifted(each, signal.name, (reach - wrap[0]) * turn) for each, turn in zip(moved, turns, strict=True)]
        train, test = tuple(whole[: len(train)]), tuple(whole[len(train) :])
        start = min(max(low / reach, -1.0), 0.0)
        half = round(2.0 * start) / 2.0
        start = half if abs(start - half) < 0.05 else start
        found.append(Direct(effect_seen_by("wraps").name, signal.name, (reach, start), (deviation, 0.0)))
    return tuple(train), tuple(test), tuple(found)


def turns_between(before: Recording, after: Recording, output: str, reach: float) -> Array:
    """Return by how many ranges (n,) each reading was moved."""
    return np.asarray(np.round((after.columns[output] - before.columns[output]) / reach))


def shifted(recording: Recording, output: str, change: Array) -> Recording:
    """Return the recording with `change` (n,) added to an output."""
    return with_column(recording, output, recording.columns[output] + change)


def _limited(output: str, columns: Sequence[Array]) -> bool:
    """Tell whether readings gather at either end of what is seen of them, as none that wraps does.

    A position at which two turns meet is read at either end where it rests there.
    """
    seen = np.concatenate(columns)
    low, whole = float(seen.min()), float(np.ptp(seen))
    near = float(np.mean(np.abs(seen - low - whole / 2.0) > (0.5 - RIM) * whole))
    return near > AT_RIM and not output.startswith("position")


def _folded(columns: Sequence[Array], expected: Sequence[Array]) -> tuple[float, float, float] | None:
    """Return the same for a reading too quick to follow, from what the plant as given would show.

    A reading that wraps uses its whole range, so that the range is what is seen of it; whole multiples of it bring the
    readings to what is expected.
    """
    seen, wanted = np.concatenate(columns), np.concatenate(expected)
    low, reach = float(seen.min()), float(np.ptp(seen))
    if not reach > 0.0 or not np.all(np.isfinite(wanted)):
        return None
    found = None
    for _ in range(RANGE_REFINED):
        turns = np.round((wanted - seen) / reach)
        if np.count_nonzero(np.diff(turns)) < FEWEST_LEAPS or np.max(np.abs(turns)) > MOST_TURNS_OFF:
            return found
        table = np.column_stack([turns, wanted, np.ones(len(seen))])
        answer = np.linalg.lstsq(table, seen, rcond=None)[0]
        left = seen - table @ answer
        plain = np.linalg.lstsq(table[:, 1:], seen, rcond=None)[0]
        if (
            np.std(left) > TELLING_WRAP * np.std(seen - table[:, 1:] @ plain)
            or abs(answer[0] / reach + 1.0) > RANGE_NEAR_SPAN
        ):
            return found  # where spikes are bent, a straight line through all may be worse than the plant as given
        reach = max(float(-answer[0]), WHOLE_RANGE * float(np.ptp(seen)))
        wanted = wanted * answer[1] + answer[2]
        found = reach, low, np.inf
    return found


def _leaping(columns: Sequence[Array], expected: Sequence[Array]) -> tuple[tuple[float, float, float] | None, float]:
    """Return the same for a reading that leaps by several ranges from row to row, and by what the plant's leaps grow.

    What else is hidden moves a reading slowly: where it leaps it goes as far as the plant as given would, but for whole
    ranges.
    """
    seen, wanted = np.concatenate(columns), np.concatenate(expected)
    low, whole = float(seen.min()), float(np.ptp(seen))
    if not whole > 0.0 or not np.all(np.isfinite(wanted)):
        return None, 0.0
    leaps, aims = (np.concatenate([np.diff(each) for each in parts]) for parts in (columns, expected))
    best: tuple[float, float, float] | None = None
    for gain in LEAP_GAINS:
        for share in SEEN_SHARES:
            reach = share * whole
            away = gain * aims - leaps
            turned = np.abs(away) > JUMP * reach
            if np.count_nonzero(turned) >= FEWEST_LEAPS:
                spread = float(np.std((away - reach * np.round(away / reach))[turned])) / reach
                best = min(best or (np.inf, 0.0, 0.0), (spread, gain, reach))
    if best is None or best[0] > MET_LEAPS:
        return None, 0.0
    _, gain, reach = best
    turns = np.round((gain * aims - leaps) / reach)
    answer = np.linalg.lstsq(np.column_stack([aims, -turns])[turns != 0.0], leaps[turns != 0.0], rcond=None)[0]
    if abs(answer[1] / reach - 1.0) > RANGE_NEAR_SPAN:
        return None, 0.0  # whole ranges are not what these leaps differ by
    return (float(answer[1]), low, np.inf), float(answer[0])


def _refined(
    plant: Plant, recordings: Sequence[Recording], name: str, turns: Sequence[Array], reach: float
) -> tuple[float, float, float]:
    """Fit the range beside the free parameters, by Gauss-Newton on the unrolled readings.

    Return it, its deviation, and the residual rms over what a fit without it leaves.
    """
    index = [signal.name for signal in plant.outputs].index(name)
    free = [p.name for p in plant.parameters if p.free and p.value > 0.0]
    logs, change, spread = np.zeros(len(free)), 0.0, 0.0
    for _ in range(RANGE_REFINED):
        base = _all_of(plant, recordings, free, logs)
        if base is None:
            return reach, spread, 1.0
        columns = []
        for place in range(len(free)):
            near = _all_of(plant, recordings, free, logs + RANGE_DIFFERENCE_STEP * (np.arange(len(free)) == place))
            columns.append(np.zeros_like(base) if near is None else (near - base) / RANGE_DIFFERENCE_STEP)
        steps = np.zeros_like(base)
        steps[:, index] = np.concatenate(turns)
        seen = np.concatenate([measured(plant, recording) for recording in recordings])
        left = seen + change * steps - base
        sizes = np.maximum(np.std(left, axis=0), 1e-12)
        tall = np.stack([each / sizes for each in (*columns, -steps)], axis=2).reshape(-1, len(free) + 1)
        prior = np.eye(len(free), len(free) + 1) / GIVEN_DEVIATION
        whole = np.concatenate([tall, prior])
        aim = np.concatenate([(left / sizes).ravel(), -logs / GIVEN_DEVIATION])
        answer = np.linalg.lstsq(whole, aim, rcond=1e-9)[0]
        logs, change = np.clip(logs + answer[:-1], -1.0, 1.0), change + float(answer[-1])
        covariance = np.linalg.pinv(whole.T @ whole)
        scores = tall * (left / sizes).reshape(-1, 1)
        parts = np.array([np.sum(part, axis=0) for part in np.array_split(scores, RANGE_BATCHES)])
        by_batches = np.std((parts @ covariance)[:, -1], ddof=1) * np.sqrt(RANGE_BATCHES)
        spread = max(float(np.sqrt(covariance[-1, -1])), float(by_batches))
    given = ((seen - base) / sizes).ravel()
    with_it, without = (
        float(np.linalg.norm(given - each @ np.linalg.lstsq(each, given, rcond=1e-9)[0]))
        for each in (tall, tall[:, :-1])
    )
    ratio = with_it / max(without, 1e-300)
    most = RANGE_NEAR_SPAN if ratio < CLOSER_RMS else UNLIKE
    return (reach + change, spread, ratio) if abs(change) < most * reach else (reach, spread, 1.0)


def _all_of(plant: Plant, recordings: Sequence[Recording], free: Sequence[str], logs: Array) -> Array | None:
    """Return the outputs (n, r) of all recordings with the free parameters moved; None where that diverges."""
    factors = dict(zip(free, np.exp(logs), strict=True))
    moved = tuple(replace(p, value=p.value * factors.get(p.name, 1.0)) for p in plant.parameters)
    try:
        parts = [simulate(replace(plant, parameters=moved), recording, None) for recording in recordings]
    except IdentifyError:
        return None
    return np.concatenate(parts)


def with_column(recording: Recording, name: str, values: Array) -> Recording:
    """Return the recording with other readings (n,) of one signal."""
    columns = {**recording.columns, name: np.ascontiguousarray(values)}
    return replace(recording, columns=MappingProxyType(columns))


def _expected(plant: Plant, recording: Recording, name: str) -> Array:
    """Return what the plant as given would show (n,); NaN where that cannot be computed."""
    index = [signal.name for signal in plant.outputs].index(name)
    try:
        return simulate(plant, recording, None)[:, index]
    except IdentifyError:
        return np.full(len(recording.time), np.nan)


def _unfolded(plant: Plant, recording: Recording, name: str, reach: float) -> Recording:
    seen = recording.columns[name]
    away = np.nan_to_num(_expected(plant, recording, name) - seen)
    return with_column(recording, name, seen + reach * np.round(away / reach))


def _unrolled(plant: Plant, recording: Recording, name: str, reach: float, gain: float = 1.0) -> Recording:
    """Follow the reading from row to row or, where `gain` times the plant as given stays by that, how far it is away.

    A current may rise by more than half a range from one row to the next, and then fall through the end of the range:
    the reading alone shows only the second.
    """
    seen, expected = recording.columns[name], gain * _expected(plant, recording, name)
    plain = np.unwrap(seen, period=reach)
    if not np.all(np.isfinite(expected)):
        return with_column(recording, name, plain)
    away = _near(np.unwrap(seen - expected, period=reach) / reach, np.diff(expected) / reach)
    beside = seen + reach * np.round((expected + reach * away - seen) / reach)
    return with_column(recording, name, min(plain, beside, key=lambda each: float(np.std(each - expected))))


def _near(away: Array, moved: Array) -> Array:
    """Return a course (n,), in ranges, less whole ones, so that it leaps little and does not stay far from nothing.

    Where it or the plant, by `moved` (n - 1,) ranges, leaps, it may have leapt the other way round: by a little more,
    but what comes after it lasts.
    """
    turns = np.arange(-MOST_TURNS_OFF, MOST_TURNS_OFF + 1)
    lasting = (np.minimum(np.abs(away[:, None] + turns), FARTHEST_LEAP) / LASTING_LEAP) ** 2
    apart = turns[None, :] - turns[:, None]
    leaps = np.diff(away)
    free = (np.abs(leaps) > LEAP_EITHER_WAY) | (np.abs(moved) > LEAP_EITHER_WAY)
    places = cheapest(
        lasting,
        lambda row: np.where(free[row - 1] | (apart == 0), (leaps[row - 1] + apart) / LEAP, np.inf) ** 2,
    )
    return np.asarray(away + turns[places])
