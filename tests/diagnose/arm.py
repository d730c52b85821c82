"""An arm in gravity on a motor, of which the angle alone is read."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tests.diagnose.cases import Motor, logged, motion

MOTOR = Motor(resistance=2.0, inductance=1e-3, constant=0.05, inertia=2e-4, friction=1e-4)
PULL = 0.02  # N m, of the arm's weight
NOISE = 1e-3  # rad
PROJECT = """schema = 1
name = "arm"
[recordings]
train = ["log.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["position_rad"]
[plant.parameters]
R_ohm = { value = 2.2, free = true }
L_H = { value = 0.001, free = false }
ke_V_s_rad = { value = 0.052, free = true }
kt_N_m_A = { value = 0.052, free = true }
J_kg_m2 = { value = 1.5e-4, free = true }
b_N_m_s_rad = { value = 1e-4, free = true }
"""


def hung(folder: Path, volts: float, seconds: float, phase: float = 0.0, friction: float = 0.0, seed: int = 5) -> Path:
    """Write the project of an arm on a motor, each voltage held for 0.4 s; it hangs at zero if `phase` is zero."""
    step, rng = 0.004, np.random.default_rng(seed)
    drive = np.repeat(rng.uniform(-volts, volts, round(seconds / 0.4)), 100)

    def pull(angle: float, speed: float) -> float:
        return PULL * math.sin(angle + phase) + friction * math.tanh(speed / 0.01)

    angle, _ = motion(MOTOR, drive, step, pull)
    read = angle + NOISE * rng.standard_normal(len(drive))
    return logged(folder, PROJECT, "time_s,voltage_V,position_rad", step * np.arange(len(drive)), drive, read)
