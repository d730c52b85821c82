"""Simulated benches of a permanent-magnet machine with a known truth: steps with a held rotor, a run-up and its end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

R, LD, LQ, FLUX, PAIRS, J, B, DRY = 0.36, 0.2e-3, 0.33e-3, 6.4e-3, 4, 4.8e-6, 1.0e-5, 4e-4
LOST = 0.25  # V that the dead time takes from each phase
STEP, ROWS = 50e-6, 1200  # s
CURRENT_NOISE, SPEED_NOISE = 0.02, 0.5  # A, rad/s rms


def locked(inductance: float, levels: Sequence[float], random: np.random.Generator) -> tuple[Array, Array]:
    """Return voltage and current of one axis, the rotor held: each level up and down."""
    held = np.repeat([sign * level for level in levels for sign in (1.0, 1.0, -1.0, -1.0)], ROWS // (4 * len(levels)))
    i, rows, lag = 0.0, [], inductance / R
    for volts in held:
        rows.append(i)
        left = STEP
        while left > 0.0:  # a piece ends where the current is 0
            sign = np.sign(i) or np.sign(volts)
            rest = (volts - sign * 4 / 3 * LOST) / R
            part = lag * math.log(1 - i / rest) if i * rest < 0.0 else math.inf
            i = rest + (i - rest) * math.exp(-left / lag) if part > left else 0.0
            left -= part
    return held, np.array(rows) + random.normal(0.0, CURRENT_NOISE, len(rows))


def turning(random: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return time, current and speed of a run-up by 2 A, by 1 A, and of what follows."""
    step, fine, w, speeds = 1e-3, 10, 0.0, []
    current = np.repeat([2.0, 1.0, 0.0], [100, 100, 200])
    for amperes in current:
        speeds.append(w)
        for _ in range(fine):
            rest = (1.5 * PAIRS * FLUX * amperes - DRY * math.tanh(w / 0.1)) / B
            w = rest + (w - rest) * math.exp(-step / fine * B / J)
    return np.arange(len(current)) * step, current, np.array(speeds) + random.normal(0.0, SPEED_NOISE, len(speeds))


def bench(random: np.random.Generator, levels: Sequence[float] = (0.8, 3.0)) -> dict[str, dict[str, Array]]:
    """Return the recordings `d`, `q` and `run`, column by column."""
    time = np.arange(ROWS) * STEP
    made = {}
    for axis, inductance in (("d", LD), ("q", LQ)):
        voltage, current = locked(inductance, levels, random)
        made[axis] = {"time_s": time[: len(voltage)], f"voltage_{axis}_V": voltage, f"current_{axis}_A": current}
    moments, amperes, speed = turning(random)
    return {**made, "run": {"time_s": moments, "current_q_A": amperes, "speed_rad_s": speed}}
