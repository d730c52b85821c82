"""PRBS: a maximum-length binary sequence, white up to half its clock.

A shift register of `order` n with the feedback taps below repeats after 2^n - 1 clocks (S. W. Golomb, Shift Register
Sequences, 1967; taps of P. Alfke, Xilinx XAPP 052, 1996). The clock is a whole number of samples.
"""

from __future__ import annotations

import numpy as np

from firmloop.identify.bench_tests.excitations import Array, Excitation, ExcitationRequest
from firmloop.identify.error import IdentifyError

TAPS = {
    3: (3, 2),
    4: (4, 3),
    5: (5, 3),
    6: (6, 5),
    7: (7, 6),
    8: (8, 6, 5, 4),
    9: (9, 5),
    10: (10, 7),
    11: (11, 9),
    12: (12, 6, 4, 1),
    13: (13, 4, 3, 1),
    14: (14, 5, 3, 1),
    15: (15, 14),
    16: (16, 15, 13, 4),
}


def make(request: ExcitationRequest) -> Array:
    """Hold each bit for `clock_s` (default 4 samples); the sequence repeats where it is shorter than the signal."""
    order = request.whole("order", 9, min(TAPS), max(TAPS))
    clock = request.positive("clock_s", 4 * request.period)
    held = round(clock / request.period)
    if held < 1:
        raise IdentifyError(
            f"experiment.clock_s is {clock:g}, below period_s = {request.period:g}; give a multiple of it"
        )
    if held >= request.samples:
        raise IdentifyError(
            f"experiment.clock_s is {clock:g} and the signal lasts {request.duration:g} s, so that it never changes; "
            "give a shorter clock_s or a longer duration_s"
        )
    bits = sequence(order)
    return np.where(bits[(np.arange(request.samples) // held) % len(bits)], request.high, request.low)


def sequence(order: int) -> Array:
    """Return one period, (2^order - 1,) of 0 and 1."""
    register, bits = [1] * order, []
    for _ in range(2**order - 1):
        bits.append(register[-1])
        register = [sum(register[tap - 1] for tap in TAPS[order]) % 2, *register[:-1]]
    return np.array(bits, dtype=np.float64)


SIGNAL = Excitation("prbs", "a maximum-length binary sequence", ("order", "clock_s"), make)
