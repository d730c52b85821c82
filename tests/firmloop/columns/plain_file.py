"""A plain recording, which every other way to write it is compared with."""

from __future__ import annotations

import numpy as np

TIME = np.round(np.arange(60) * 0.05, 2)
VOLT = np.round(3.0 * np.sin(TIME) + 0.25, 3)
HEAT = np.round(2.0 * np.cos(TIME), 3)
HEADER = "time_s,voltage_V,temperature_C"
ROWS = [f"{t:.2f},{u:.3f},{y:.3f}" for t, u, y in zip(TIME, VOLT, HEAT, strict=True)]
PLAIN = "\n".join([HEADER, *ROWS, ""])


def alike(columns: dict[str, np.ndarray], *, time: str = "time_s", volt: str = "voltage_V") -> None:
    np.testing.assert_allclose(columns[time], TIME, atol=1e-12)
    np.testing.assert_allclose(columns[volt], VOLT, rtol=1e-12)


def rows_of(*columns: np.ndarray, mark: str = ",", end: str = "") -> list[str]:
    return [mark.join(f"{value:.9g}" for value in row) + end for row in zip(*columns, strict=True)]
