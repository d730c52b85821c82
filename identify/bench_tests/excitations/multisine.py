"""Multisine: sines of equal height at multiples of 1/duration, with phases that keep the crest low.

The phases begin as M. R. Schroeder's (IEEE Trans. Information Theory 16 (1970) 85-89), which suit lines at even
distances; then the wave is clipped and its phases are kept, again and again (E. Van der Ouderaa, J. Schoukens and
J. Renneboog, IEEE Trans. Instrumentation and Measurement 37 (1988) 145-147).
"""

from __future__ import annotations

import math

import numpy as np

from firmloop.identify.bench_tests.excitations import Array, Excitation, ExcitationRequest
from firmloop.identify.error import IdentifyError

CLIPPINGS = 1000
WORK = 30_000_000  # samples in all, so that a long signal does not take minutes
CLIPPED = 0.75  # of the peak


def make(request: ExcitationRequest) -> Array:
    """Spread `lines` sines (default 30) over `low_Hz` to `high_Hz`, logarithmically, each on a whole cycle."""
    base, top = 1.0 / request.duration, 0.4 / request.period
    low, high = request.positive("low_Hz", base), request.positive("high_Hz", top)
    if not base * (1 - 1e-9) <= low < high <= 0.5 / request.period:
        raise IdentifyError(
            f"experiment.low_Hz is {low:g} and high_Hz {high:g}; they must rise and lie within {base:.4g} (one cycle) "
            f"and {0.5 / request.period:.4g} (half the sampling rate)"
        )
    wanted = np.geomspace(low, high, request.whole("lines", 30, 1, 10_000)) / base
    orders = np.unique(np.maximum(np.round(wanted), 1.0))
    count = len(orders)
    places = orders.astype(int)
    steps = np.arange(1, count + 1)
    spectrum = np.zeros(request.samples // 2 + 1, dtype=np.complex128)
    spectrum[places] = np.exp(-1j * math.pi * steps * (steps - 1) / count)
    wave = np.fft.irfft(spectrum, request.samples)
    best = wave
    for _ in range(min(CLIPPINGS, WORK // request.samples)):
        top = CLIPPED * np.abs(wave).max()
        clipped = np.fft.rfft(np.clip(wave, -top, top))[places]
        spectrum[places] = clipped / np.maximum(np.abs(clipped), 1e-300)
        wave = np.fft.irfft(spectrum, request.samples)
        best = wave if np.abs(wave).max() < np.abs(best).max() else best
    middle, half = (request.high + request.low) / 2, (request.high - request.low) / 2
    return np.asarray(middle + half * best / np.abs(best).max())


SIGNAL = Excitation("multisine", "many sines at once, with a low crest", ("low_Hz", "high_Hz", "lines"), make)
