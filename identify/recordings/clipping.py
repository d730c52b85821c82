"""Find where a recorded signal is cut off: it rests at its largest or smallest value while it should go on moving."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_RUN = 5  # rows at exactly one value: fewer may be chance
_STEEP = 4.0  # resolutions a row, and of noise: slower, and it may just have settled
_ALTERNATE = -1 / 3  # correlation of neighboring second differences: -2/3 in white noise
_NEAR = 0.05  # of the largest reading: a band, if the noise is not wider
_SPREAD = 2.0  # deviations of noise to either side of a limit
_MEDIAN = 1.0 / (0.6745 * math.sqrt(6.0))  # from the median second difference of white noise to its rms
_HELD, _GATHERED = 0.02, 3.0  # share of rows in a band; times as many as in the band below and above all
_STEADY = 0.5  # ratio of the last two steps before it rests: what settles slows down first


@dataclass(frozen=True, slots=True)
class Clipped:
    """A signal that is cut off at `value` (its unit) in `share` of the rows."""

    value: float
    share: float


def cut_off(values: Array) -> Clipped | None:
    """Return where a signal (n,) is cut off, None where it is not.

    It has to come to its extreme value at full speed and stay there to the last digit, or to stay there to the last
    digit where its noise is far above the resolution. Zero and where it began may be rest.
    """
    steps = np.abs(np.diff(values))
    moving = steps[steps > 0.0]
    if not len(moving):
        return None
    resolution = float(moving.min())
    for extreme in (float(values.max()), float(values.min())):
        if extreme in (0.0, float(values[0])):
            continue
        resting = values == extreme
        noisy = _noise(values, resting) > _STEEP * resolution
        edges = np.flatnonzero(np.diff(np.concatenate([[False], resting, [False]])))
        runs = [(first, last) for first, last in edges.reshape(-1, 2).tolist() if last - first >= _RUN]
        cut = [last - first for first, last in runs if noisy or _arrives(values, first, resolution)]
        if cut:
            return Clipped(extreme, sum(cut) / len(values))
    return None


def in_steps(values: Array, extreme: float) -> bool:
    """Tell whether a signal (n,) rests at other values than its extreme as well: it goes in steps, and this is one."""
    return bool(_rests(values).keys() - {0.0, extreme, float(values[0])})


def holds_elsewhere(values: Array, extreme: float) -> bool:
    """Tell whether a signal (n,) rests as long at another value as at its extreme: that is no limit, it was held there.

    Zero and where it began may be rest, however long.
    """
    rests = _rests(values)
    others = [rows for value, rows in rests.items() if value not in (0.0, extreme, float(values[0]))]
    return max(others, default=0) >= rests.get(extreme, 0) > 0


def _rests(values: Array) -> dict[float, int]:
    """Return how many rows the longest rest at each value takes, of those that are no chance."""
    found: dict[float, int] = {}
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    for first, last in pairwise([0, *edges.tolist(), len(values)]):
        if last - first >= _RUN:
            found[float(values[first])] = max(found.get(float(values[first]), 0), last - first)
    return found


def _noise(values: Array, resting: NDArray[np.bool_]) -> float:
    """Return a typical second difference where a signal does not rest, 0 where those keep their sign: no noise does."""
    bends = np.diff(values, 2)
    free = ~(resting[2:] | resting[1:-1] | resting[:-2])
    bends[~free] = 0.0
    alternate = float(bends[1:] @ bends[:-1]) < _ALTERNATE * float(bends @ bends)
    return float(np.median(np.abs(bends[free]))) if alternate and np.sum(free) > _RUN else 0.0


def _arrives(values: Array, first: int, resolution: float) -> bool:
    """Tell whether a signal came to row `first` without slowing down."""
    if first < 4:
        return False
    before, last, into = np.diff(values[first - 3 : first + 1]) * np.sign(values[first] - values[first - 1])
    return bool(into > 0.0 and last > _STEEP * resolution and last > _STEADY * before > 0.0)


@dataclass(frozen=True, slots=True)
class Gathering:
    """Readings whose magnitude gathers within `half` of `level` (their unit)."""

    level: float
    half: float


def gathering(columns: Sequence[Array]) -> Gathering | None:
    """Return where readings (n,) gather near their largest magnitude, as at a limit with noise behind it, or None.

    What comes to rest there gathers, too; what never changes gathers nowhere.
    """
    readings = np.concatenate(columns)
    if np.ptp(readings) == 0.0:
        return None
    sizes = np.sort(np.abs(readings))
    top = float(sizes[-1])
    bends = np.abs(np.concatenate([np.diff(column, 2) for column in columns]))
    half = max(0.5 * _NEAR * top, _SPREAD * _MEDIAN * float(np.median(bends)) if len(bends) else 0.0)
    bands = np.arange(top - 2.0 * half, 0.5 * top, -0.25 * half)  # lower ends of bands of 2 half
    counts = [np.searchsorted(sizes, bands + k * half, "right") for k in (-2.0, 0.0, 2.0)]
    held, below, above = counts[2] - counts[1], counts[1] - counts[0], len(sizes) - counts[2]
    gathered = np.flatnonzero((held > _HELD * len(sizes)) & (held > _GATHERED * below) & (held > _GATHERED * above))
    if not len(gathered):
        return None
    band = bands[gathered[np.argmax(held[gathered])]]
    return Gathering(float(np.median(sizes[(sizes >= band) & (sizes <= band + 2.0 * half)])), half)


def rested(columns: Sequence[Array]) -> float:
    """Return the magnitude that a limit of readings (n,) is not below: they rest at their largest to the last digit.

    Less than that by one step of their resolution; 0 where they do not rest there, and noise may be behind a limit.
    """
    sizes = np.abs(np.concatenate(columns))
    levels = np.unique(sizes)
    if len(levels) < 2 or np.mean(sizes == levels[-1]) < _HELD:
        return 0.0
    return float(levels[-1] - np.diff(levels).min())
