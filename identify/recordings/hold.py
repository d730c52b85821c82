"""Say what an input did between its rows: held, a straight line, or the smooth curve of a band-limited signal.

A controller holds its output, and so does a recording by default. An input that was measured behind an anti-alias
filter is a smooth curve instead; taken as held it would look half a sample late.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError

Array = NDArray[np.float64]

HOLDS = ("zero_order", "linear", "band_limited")
FINER = 4  # knots of straight lines per row
_ENDS = 256  # rows by which the ends are continued, so that the transform sees no jump
_EVEN = 1e-3  # of the step: rows that are further from even have no spectrum


def knots(hold: str, time: Array, drive: Array, source: str) -> tuple[Array, Array]:
    """Return moments (k,) and values (k, m) between which the inputs `drive` (n, m) are straight lines.

    Band-limited: the spectrum is continued with zeros to a finer grid and divided by that of a straight-line hold,
    (sin(x) / x)^2, so that the straight lines have the spectrum of the signal up to half its sampling rate (Schoukens,
    Pintelon & Rolain, Mastering System Identification in 100 Exercises, ch. 2, on hold assumptions).
    """
    if hold == "linear":
        return time, drive
    steps = np.diff(time)
    if float(np.max(np.abs(steps - steps.mean()))) > _EVEN * float(steps.mean()):
        raise IdentifyError(
            f"{source}: recordings.hold is band_limited, but its rows are {steps.min():g} to {steps.max():g} s apart; "
            f'resample the file evenly, or use hold = "linear"'
        )
    reach = min(_ENDS, len(drive) - 1)
    before, behind = 2.0 * drive[0] - drive[reach:0:-1], 2.0 * drive[-1] - drive[-2 : -2 - reach : -1]
    whole = np.concatenate([before, drive, behind])
    line = np.linspace(0.0, 1.0, len(whole))[:, None] * (whole[-1] - whole[0]) + whole[0]
    size = _fast(len(whole))
    padded = np.concatenate([whole - line, np.zeros((size - len(whole), drive.shape[1]))])
    spectrum = np.fft.rfft(padded, axis=0)
    lines = np.sinc(np.arange(len(spectrum)) / (size * FINER)) ** 2
    fine = FINER * np.fft.irfft(spectrum / lines[:, None], size * FINER, axis=0)
    count = FINER * (len(time) - 1) + 1
    moments = np.interp(np.arange(count) / FINER, np.arange(len(time)), time)
    ramp = np.stack([np.interp(reach + np.arange(count) / FINER, np.arange(len(whole)), each) for each in line.T], 1)
    return moments, np.ascontiguousarray(fine[FINER * reach : FINER * reach + count] + ramp)


def _fast(length: int) -> int:
    """Return the next length that is a product of 2, 3 and 5 alone, whose transform is fast."""
    size = length
    while True:
        rest = size
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return size
        size += 1
