"""Prove how far the state of a PID can go while its factors change from sample to sample.

`pids` are the corners of what the factors may be. The derivative is at most max|kd/(tf+h)| times the range of x, over
1 - max|tf/(tf+h)|. The integral's argument in `pid_range.py` holds sample by sample and is linear in each factor, hence
over all corners of the factors.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from firmloop.design.kinds.pid.ranges import Pid, integral_range, state_ranges
from firmloop.design.linear.reach import widened
from firmloop.identify.signal import Signal

ARGUMENT = "max|kd/(tf+h)| times the range of c r - y, over 1 - max|tf/(tf+h)|"
MOVED = ("kp", "ki", "b", "tracking", "u_min", "u_max")  # factors that the integral's range depends on


def whole_pid(pids: Sequence[Pid]) -> Pid:
    """Return a PID that has every term that one of `pids` has."""

    def some(name: str) -> float:
        return next((getattr(pid, name) for pid in pids if getattr(pid, name) != 0), 0.0)

    return replace(pids[0], kp=some("kp"), ki=some("ki"), kd=some("kd"), tf=some("tf"), tracking=some("tracking"))


def box_ranges(
    pids: Sequence[Pid], whole: Pid, reference: Signal, measurement: Signal, output: Signal
) -> tuple[tuple[Signal, str], ...]:
    """Put the wider ranges that changing factors allow in place of those of constant ones."""
    ends = (reference.low, reference.high), (measurement.low, measurement.high)
    x = [c * r - y for c in {pid.c for pid in pids} for r, y in itertools.product(*ends)]
    slope = max(abs(pid.slope) for pid in pids)
    left = min(min(pid.follow, 1 + pid.forget) for pid in pids)  # 1 - |forget|
    d_high = slope * (max(x) - min(x)) / left if whole.differentiates else 0.0
    low = high = 0.0
    if whole.integrates:
        for values in itertools.product(*({getattr(pid, name) for pid in pids} for name in MOVED)):
            corner = replace(whole, **dict(zip(MOVED, values, strict=True)))
            one, other = integral_range(corner, reference, measurement, d_high)
            low, high = min(low, one - whole.added), max(high, other + whole.added)
    wider = {
        "integral": lambda: widened("integral", output.unit, low, high),
        "derivative": lambda: widened("derivative", output.unit, -d_high, d_high),
        "last": lambda: widened("last", measurement.unit, min(x), max(x)),
    }
    return tuple(
        (wider[signal.name](), ARGUMENT if signal.name == "derivative" else why)
        if signal.name in wider
        else (signal, why)
        for signal, why in state_ranges(whole, reference, measurement, output, varying=True)
    )
