"""A fleet of heaters: first-order lags that are alike but for their tolerances, and one that changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

PROJECT = """\
schema = 1
name = "heater"

[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]

[plant.parameters]
gain = { value = 3.0, free = true }
time_constant_s = { value = 2.0, free = true }
delay_s = { value = 0.0, free = false }
"""
GAINS = (2.97, 3.02, 3.0, 2.95, 3.04, 3.01)  # degC/V
LATER = (3.02, 2.99, 4.2, 4.2)  # of the machine with several recordings, by date
CHANGED = "heater_9"


def recorded(gain: float, seed: int) -> str:
    """A lag of 2 s behind random steps, with a little noise."""
    random = np.random.default_rng(seed)
    state, lines = 0.0, ["time_s,voltage_V,temperature_C"]
    for row, u in enumerate(np.repeat(random.uniform(-5, 5, 12), 12)):
        lines.append(f"{row * 0.1:.1f},{u:.6g},{state + random.normal(0, 0.02):.6g}")
        state += (1 - np.exp(-0.1 / 2.0)) * (gain * u - state)
    return "\n".join(lines) + "\n"


def write_heaters(folder: Path) -> Path:
    """Write six machines of one recording and one of four, and the project beside them; return the project."""
    for number, gain in enumerate(GAINS, start=1):
        path = folder / "fleet" / f"heater_{number}.csv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(recorded(gain, number))
    for number, gain in zip((1, 2, 10, 11), LATER, strict=True):  # week_10 comes after week_2
        path = folder / "fleet" / CHANGED / f"week_{number}.csv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(recorded(gain, 100 + number))
    project = folder / "heater.toml"
    project.write_text(PROJECT)
    return project
