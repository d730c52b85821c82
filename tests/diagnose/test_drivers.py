"""What a motor's driver does is named, and its size told, by the speed alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.diagnose.cases import Motor, lag_project, logged, said_of, turned

TOLD = (0.0314, 9.0e-6, 5.5e-6)  # ke, J, b as the project has them
LAG = lag_project("voltage_V", "speed_rad_s", 28.0, 0.03)


def _project(folder: Path, motor: Motor, lowest: float) -> Path:
    """Log a motor from rest, driven by levels from `lowest` to 12 V; return the project file."""
    rng, rows = np.random.default_rng(31), 2000
    drive = _levels(rng, rows, lowest)
    return turned(folder, motor, TOLD, drive, lambda angle: 0.0, 0.4 * rng.normal(size=rows))


def _levels(rng: np.random.Generator, rows: int, lowest: float) -> NDArray[np.float64]:
    """Return levels (n,) of voltage from `lowest` to 12 V, held for a while each, after a rest."""
    drive = np.repeat(rng.uniform(lowest, 12.0, rows), rng.integers(20, 160, rows))[:rows]
    drive[:10] = 0.0
    return np.asarray(drive)


def _explained(said: dict[str, Any], name: str, parameter: str, true: float) -> None:
    assert said["verdict"] == "explained"
    (effect,) = said["effects"]
    assert effect["name"] == name
    low, high = effect["parameters"][parameter]["ci95"]
    assert low <= true <= high and high - low < 0.03 * true


def test_a_driver_that_limits_its_current_is_told_from_saturated_iron(tmp_path: Path) -> None:
    said = said_of(_project(tmp_path, Motor(4.2, 0.0063, 0.0321, 8.1e-6, 6.4e-6, limit=0.9), -12.0))
    _explained(said, "current_limit", "current_A", 0.9)


def test_a_driver_that_does_not_brake_is_neither_friction_nor_inertia(tmp_path: Path) -> None:
    said = said_of(_project(tmp_path, Motor(4.2, 0.0021, 0.0321, 8.1e-6, 6.4e-6, brakes=False), 0.0))
    _explained(said, "freewheeling", "share", 1.0)


def test_a_lag_that_falls_slower_than_it_rises_runs_free(tmp_path: Path) -> None:
    rng, rows, step, share, speed = np.random.default_rng(31), 2000, 1e-3, 0.79, 0.0
    drive, read = _levels(rng, rows, 0.0), np.empty(2000)
    for k, voltage in enumerate(drive):
        read[k] = speed + 0.4 * rng.normal()
        for _ in range(20):
            driven = 30.0 * voltage - share * speed
            speed += step / 20 * (max(driven, 0.0) - (1.0 - share) * speed) / 0.04
    columns = ("time_s,voltage_V,speed_rad_s", step * np.arange(rows), drive, read)
    _explained(said_of(logged(tmp_path, LAG, *columns)), "freewheeling", "share", share)
