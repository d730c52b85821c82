"""Ramps through zero: slow triangles, which show friction where the direction turns and gain everywhere else."""

from __future__ import annotations

import numpy as np

from firmloop.identify.bench_tests.excitations import Array, Excitation, ExcitationRequest
from firmloop.identify.error import IdentifyError


def make(request: ExcitationRequest) -> Array:
    """Go from 0 to high, through 0 to low, and back to 0, `cycles` times (default 2)."""
    if not request.low < 0.0 < request.high:
        raise IdentifyError(
            f"experiment.low is {request.low:g} and high {request.high:g}; ramps go through zero, so that low must be "
            "below 0 and high above"
        )
    cycles = request.whole("cycles", 2, 1, 1000)
    share = (request.time / request.duration * cycles) % 1.0
    span = request.high - request.low
    first = 0.5 * request.high / span  # the slope is the same everywhere
    return np.asarray(np.interp(share, [0.0, first, first + 0.5, 1.0], [0.0, request.high, request.low, 0.0]))


SIGNAL = Excitation("ramps", "slow triangles through zero", ("cycles",), make)
