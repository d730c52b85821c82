"""What a recording shows without any simulation: readings that wrap around, and readings in coarse steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from identify.plant import Plant
from identify.recording import Recording

Array = NDArray[np.float64]

DIRECT = ("sensor_wrap", "sensor_quantization")
_JUMP = 0.5  # of the range: a change from row to row that only a wrap makes
_EDGE = 0.25  # of the range: a wrap begins and ends this near to its ends
_BACK = 0.08  # of the range: rows beside a wrap go against it, but for noise
_CALM = 0.2  # of the range: a reading that usually moves more from row to row cannot be unrolled
_UNLIKE = 0.05  # of the range, by which wraps differ
_FEWEST = 2  # jumps in all recordings
_COARSE = 0.004  # of the range: finer steps are what any sensor has
_TURN = 2.0 * np.pi / 200.0  # rad: no encoder has fewer steps a turn unless it is a coarse one
_OWN = 0.45  # residual rms over step up to which the steps, and not noise, are what is left
_EVEN = 1e-3  # of a step, by which a multiple may be off


@dataclass(frozen=True, slots=True)
class Direct:
    """A sensor's effect that was read off: values and standard deviations in the order of its parameters."""

    effect: str
    output: str
    values: tuple[float, ...]
    deviations: tuple[float, ...]


def unwrapped(
    plant: Plant, train: Sequence[Recording], test: Sequence[Recording]
) -> tuple[tuple[Recording, ...], tuple[Recording, ...], tuple[Direct, ...]]:
    """Return the recordings with every reading that wraps unrolled, and what was found."""
    found = []
    for signal in plant.outputs:
        wrap = _wrap([recording.columns[signal.name] for recording in train])
        if wrap is None:
            continue
        reach, deviation, low = wrap
        train, test = (
            tuple(_unrolled(recording, signal.name, reach) for recording in group) for group in (train, test)
        )
        start = min(max(low / reach, -1.0), 0.0)
        whole = round(2.0 * start) / 2.0
        start = whole if abs(start - whole) < 0.05 else start
        found.append(Direct("sensor_wrap", signal.name, (reach, start), (deviation, 0.0)))
    return tuple(train), tuple(test), tuple(found)


def _wrap(columns: Sequence[Array]) -> tuple[float, float, float] | None:
    """Return range, its standard deviation and the lowest reading; None where nothing wraps."""
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    reach = high - low
    sizes = []
    for column in columns:
        steps = np.diff(column)
        if float(np.median(np.abs(steps))) > _CALM * reach:
            return None
        for row in np.flatnonzero(np.abs(steps) > _JUMP * reach):
            begin, end, side = column[row], column[row + 1], float(np.sign(steps[row]))
            if max(begin, end) < high - _EDGE * reach or min(begin, end) > low + _EDGE * reach:
                return None
            around = [steps[k] for k in (row - 1, row + 1) if 0 <= k < len(steps) and abs(steps[k]) <= _JUMP * reach]
            if any(side * step > _BACK * reach for step in around):
                return None  # a wrap goes against the motion around it
            sizes.append(abs(float(steps[row])) - side * float(np.mean(around)) if around else reach)
    usual = np.array(sizes)
    if len(usual) < _FEWEST or float(np.std(usual)) > _UNLIKE * reach:
        return None
    return float(np.median(usual)), float(1.25 * np.std(usual) / np.sqrt(len(usual))), low


def _unrolled(recording: Recording, name: str, reach: float) -> Recording:
    columns = dict(recording.columns)
    columns[name] = np.ascontiguousarray(np.unwrap(columns[name], period=reach))
    return replace(recording, columns=MappingProxyType(columns))


def coarse(plant: Plant, train: Sequence[Recording], left: Sequence[float]) -> tuple[Direct, ...]:
    """Return the outputs whose steps are most of what an explanation leaves over; `left` (r,) is its residual rms."""
    found = []
    for signal, rms in zip(plant.outputs, left, strict=True):
        values = np.concatenate([recording.columns[signal.name] for recording in train])
        step = _step(values)
        least = _TURN if signal.unit == "rad" else _COARSE * float(np.ptp(values))
        if step is not None and step > least and rms < _OWN * step:
            found.append(Direct("sensor_quantization", signal.name, (step,), (_EVEN * step,)))
    return tuple(found)


def _step(values: Array) -> float | None:
    """Return the step of which all values are multiples, None where there is none."""
    levels = np.unique(np.round(values, 12))
    if not 2 < len(levels) < len(values) / 4:
        return None
    gaps = np.diff(levels)
    step = float(gaps.min())
    step = float(np.mean(gaps[gaps < 1.5 * step]))
    counts = np.round((levels - levels[0]) / step)
    if np.any(np.abs(levels - levels[0] - counts * step) > _EVEN * step * (20.0 + counts)):
        return None
    return float((levels[-1] - levels[0]) / counts[-1])
