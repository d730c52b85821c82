"""Steps: a new level every `hold_s`, up and down in turn, so that every one is reached from both sides."""

from __future__ import annotations

import numpy as np

from firmloop.identify.bench_tests.excitations import Array, Excitation, ExcitationRequest


def make(request: ExcitationRequest) -> Array:
    """Go through `levels` values from low to high and back; by default low and high alone, for half the time each."""
    levels = request.whole("levels", 2, 2, 1000)
    up = np.linspace(request.low, request.high, levels)
    course = np.concatenate([up, up[-2:0:-1]]) if levels > 2 else up
    hold = request.positive("hold_s", request.duration / len(course))
    return np.asarray(course[(request.time / hold + 1e-9).astype(int) % len(course)])


SIGNAL = Excitation("steps", "a staircase up and down", ("levels", "hold_s"), make)
