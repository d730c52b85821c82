"""Estimate each sensor's own noise: the white part of what is left over, where no disturbance can move an output."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import (
    FLAT_BY_CHANCE,
    HANN_BINS,
    LEAST_NOISE,
    LINE_POWER,
    MEDIAN_POWER,
    SENSOR_BAND_BINS,
    SENSOR_BANDS,
)

Array = NDArray[np.float64]


def sensor_noises(residuals: Sequence[Array], floors: Array) -> tuple[float, ...]:
    """Return the rms of every sensor's own noise, from residuals (n, r) of several recordings.

    A machine follows no disturbance at the highest frequencies, and what an explanation still misses is slow as well:
    there a spectrum is flat, at the power of white noise. The flat part begins at half the sampling rate and goes down
    as far as chance allows; lines, such as the mains, do not count. All of the rms where the whole spectrum is flat.
    Each recording has its own noise, of which the rms over all rows is returned. `floors` (r,) are the smallest noise
    that a sensor of this resolution can have.
    """
    rows = np.array([len(part) for part in residuals])
    powers = np.array([[_white_part(column) ** 2 for column in part.T] for part in residuals])
    sizes = np.sqrt(rows @ powers / rows.sum())
    return tuple(float(size) for size in np.maximum(np.maximum(sizes, floors), LEAST_NOISE))


def _white_part(values: Array) -> float:
    """Return the rms of the white part of one output's residuals (n,)."""
    rms = float(np.sqrt(np.mean(values**2)))
    if not np.isfinite(rms) or not rms > 0.0:
        return rms
    bands = _banded(values)
    level, accepted = _level(bands[:1]), 1
    while accepted < len(bands):
        nearest = bands[accepted]
        sure = FLAT_BY_CHANCE * np.sqrt(HANN_BINS / len(nearest) + HANN_BINS / sum(map(len, bands[:accepted])))
        if not abs(np.log(_level([nearest]) / level)) < sure:
            break
        accepted += 1
        level = _level(bands[:accepted])
    whole = accepted == len(bands) and np.max(np.concatenate(bands)) < LINE_POWER * level
    return rms if whole else min(float(np.sqrt(level)), rms)


def _banded(values: Array) -> list[Array]:
    """Return the powers of the residuals' spectra by bands of frequency, the highest first, in units of a variance."""
    taper = np.hanning(len(values) + 2)[1:-1]
    spectrum = np.fft.rfft(taper * (values - np.mean(values)))[1:]
    falling = np.abs(spectrum[::-1]) ** 2 / float(taper @ taper)
    count = max(min(SENSOR_BANDS, len(falling) // SENSOR_BAND_BINS), 1)
    return [np.maximum(part, 1e-300) for part in np.array_split(falling, count)]


def _level(bands: Sequence[Array]) -> float:
    """Return the mean power of bands without their lines, which are far above the median."""
    powers = np.concatenate(bands)
    median = float(np.median(powers)) / MEDIAN_POWER
    return float(np.mean(powers[powers < LINE_POWER * median]))
