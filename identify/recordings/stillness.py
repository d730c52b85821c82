"""Which readings stand still, and which rows come before anything drives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STILL = 4.0  # deviations by which the differences of white noise may be smaller than they should be
_UNDRIVEN = 0.01  # of the largest input: less drives nothing
FEWEST = 5  # rows before an input, from which they tell where a plant rests


def moves(values: Array) -> bool:
    """Tell whether one of several readings (n, r) does more than white noise.

    Successive differences of white noise have twice its variance (J. von Neumann, Annals of Mathematical Statistics 12
    (1941) 367-395); those of anything that moves have less.
    """
    away = values - values.mean(axis=0)
    power, rows = np.sum(away**2, axis=0), len(away)
    ratio = np.sum(np.diff(away, axis=0) ** 2, axis=0) / np.where(power > 0.0, power, 1.0)
    return bool(np.any((np.ptp(values, axis=0) > 0.0) & (ratio < 2.0 - 2.0 * _STILL / np.sqrt(rows))))


def driven(drive: Array, most: Array) -> NDArray[np.bool_]:
    """Tell the rows (n,) in which an input (n, m) drives something; `most` (m,) are the largest inputs."""
    return np.asarray(np.any(np.abs(drive) > _UNDRIVEN * most, axis=1))


def resting(readings: Array, drive: Array, most: Array) -> Array:
    """Return the readings (q, r) of (n, r) before an input (n, m) drives anything, if the plant rests there, else none.

    `most` (m,) are the largest inputs.
    """
    acts = driven(drive, most)
    first = readings[: int(np.argmax(acts)) if np.any(acts) else None]
    return first if len(first) >= FEWEST and not moves(first) else first[:0]
