"""Chirp: one sine that sweeps from `low_Hz` to `high_Hz`, as much time per octave everywhere."""

from __future__ import annotations

import numpy as np
import scipy

from firmloop.identify.bench_tests.excitations import Array, Excitation, ExcitationRequest
from firmloop.identify.error import IdentifyError


def make(request: ExcitationRequest) -> Array:
    """Sweep once, from the middle of the range; by default from one cycle to a fifth of the sampling rate."""
    low, high = request.positive("low_Hz", 1.0 / request.duration), request.positive("high_Hz", 0.2 / request.period)
    if not low < high <= 0.5 / request.period:
        raise IdentifyError(
            f"experiment.low_Hz is {low:g} and high_Hz {high:g}; they must rise and stay below "
            f"{0.5 / request.period:.4g}, half the sampling rate"
        )
    wave = scipy.signal.chirp(request.time, low, request.duration, high, method="logarithmic", phi=-90)
    return np.asarray((request.high + request.low) / 2 + (request.high - request.low) / 2 * wave)


SIGNAL = Excitation("chirp", "a sine that sweeps through the frequencies", ("low_Hz", "high_Hz"), make)
