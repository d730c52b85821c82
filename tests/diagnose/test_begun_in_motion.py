"""Recordings that begin at a steady speed: from rest no simulation of them tells anything."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from firmloop.cli import main
from tests.diagnose.cases import lag_project

LATE, STEP = 0.12, 0.01  # s
PROJECT = lag_project("voltage_V", "speed_rad_s", 25.0, 0.3, ("a.csv", "b.csv"))


def test_what_explains_them_is_written_however_far_off_it_is_from_rest(tmp_path: Path) -> None:
    """It had stayed the plain refit, which comes up from rest sooner than what lags behind it."""
    rng = np.random.default_rng(5)
    for name, level in (("a", 11.0), ("b", 13.0)):
        drive = np.repeat([level, 15.0], 100)
        speed = seen = 25.0 * level
        read = np.empty(len(drive))
        for k, voltage in enumerate(drive):
            read[k] = seen + 0.5 * rng.normal()
            for _ in range(20):
                speed += STEP / 20 * (25.0 * voltage - speed) / 0.3
                seen += STEP / 20 * (speed - seen) / LATE
        rows = np.column_stack([STEP * np.arange(len(drive)), drive, read])
        head = "time_s,voltage_V,speed_rad_s"
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=head, comments="", fmt="%.7g")
    (tmp_path / "project.toml").write_text(PROJECT, encoding="utf-8")
    assert main(["diagnose", str(tmp_path / "project.toml"), "--out", str(tmp_path / "out")]) == 1
    (lag,) = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]["effects"]
    low, high = lag["time_constant_s"]["ci95"]
    assert lag["name"] == "sensor_lag" and low < LATE < high
