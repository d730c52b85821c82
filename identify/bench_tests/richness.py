"""Count how many coefficients an input can tell apart: one by its mean, two by every sine in it.

An input is persistently exciting of order k where its spectrum is not zero at k frequencies (L. Ljung, System
Identification, 1999, section 13.2), and a model of order n has 2 n coefficients. The sines are taken out one by one,
each at the frequency that leaves least, until LEAST of the input's power is left: so much of a measured sine is noise,
which the plant never saw.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST = 1e-3  # of the power: a sine that is measured with 3 % of noise is one sine
PADDED = 4  # times as many frequencies as rows have


def richness(drives: Sequence[Array], enough: int) -> int:
    """Return how many coefficients the inputs can tell apart together, counted up to `enough`."""
    mean, sines = 0, list[float]()
    for drive in drives:
        found_mean, found = _lines(drive, enough)
        mean = max(mean, found_mean)
        sines += [one for one in found if all(abs(one - known) > 0.5 / len(drive) for known in sines)]
    return min(mean + 2 * len(sines), enough)


def _lines(drive: Array, enough: int) -> tuple[int, list[float]]:
    """Return 1 where the mean counts, and the frequencies in cycles a row."""
    rows, power = len(drive), float(drive @ drive)
    moving = drive - drive.mean()
    basis, left, found = np.ones((rows, 1)), moving, list[float]()
    while left @ left > LEAST * (moving @ moving) and 2 * len(found) < enough:
        spectrum = np.abs(np.fft.rfft(left, PADDED * rows))
        peak = (1 + int(np.argmax(spectrum[1:]))) / (PADDED * rows)

        def rest(frequency: float, known: Array = basis) -> Array:
            return _rest(np.hstack([known, _wave(frequency, rows)]), moving)

        ends = (max(peak - 1 / rows, 0.05 / rows), min(peak + 1 / rows, 0.5))
        best = scipy.optimize.minimize_scalar(
            lambda one, rest=rest: float(np.sum(rest(one) ** 2)), bounds=ends, method="bounded", options={"xatol": 1e-9}
        ).x
        basis, left = np.hstack([basis, _wave(best, rows)]), rest(best)
        found.append(float(best))
    mean = float(np.linalg.lstsq(basis, drive, rcond=None)[0][0])  # that of cycles which end within is no mean
    return int(rows * mean**2 > LEAST * power), found


def _wave(frequency: float, rows: int) -> Array:
    turn = 2 * np.pi * frequency * np.arange(rows)
    return np.column_stack([np.cos(turn), np.sin(turn)])


def _rest(basis: Array, values: Array) -> Array:
    return np.asarray(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])
