"""Turn the ticks of a target's timer into instructions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import Target


def instructions(ticks: NDArray[np.uint32], overhead_ticks: int, target: Target) -> NDArray[np.int64]:
    """Return how many instructions each step took, from the call of step() to its return; exact and repeatable.

    Under QEMU's -icount, every instruction takes 2**icount_shift ns and the timer ticks every 1e9 / clock_hz ns.
    `overhead_ticks` is what reading the timer twice takes. Rounding makes up for readings being cut to whole ticks,
    as long as a tick is well below half an instruction.
    """
    assert target.qemu is not None and target.clock_hz is not None
    per_tick = 1e9 / target.clock_hz / 2**target.qemu.icount_shift
    assert per_tick <= 0.25, f"{target.name}: a tick of {per_tick:.2f} instructions cannot count single ones"
    counted: NDArray[np.int64] = np.rint((ticks.astype(np.float64) - overhead_ticks) * per_tick).astype(np.int64)
    return counted
