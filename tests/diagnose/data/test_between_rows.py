"""What an input does between its rows is no project's secret: another hold than the given one is said."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from tests.diagnose.cases import diagnosis, logged

PROJECT = """schema = 1
name = "ramped"
[recordings]
train = ["log.csv"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = { value = 19.0, free = true }
time_constant_s = { value = 0.11, free = true }
"""


def test_an_input_that_moves_between_its_rows_is_said_and_written(tmp_path: Path) -> None:
    rng, rows, step, fine = np.random.default_rng(3), 1500, 0.02, 40
    knots = np.concatenate([np.zeros(5), np.convolve(rng.normal(0.0, 6.0, rows), np.ones(4) / 4.0, "same")[:-5]])
    drive = np.interp(np.arange(rows * fine) / fine, np.arange(rows), knots)
    speed, read = 0.0, np.empty(rows)
    for k in range(rows * fine):
        if k % fine == 0:
            read[k // fine] = speed
        speed += step / fine * (20.0 * drive[k] - speed) / 0.1
    noisy = read + rng.normal(0.0, 0.2, rows)
    project = logged(tmp_path, PROJECT, "time_s,voltage_V,speed_rad_s", step * np.arange(rows), knots, noisy)
    _, said = diagnosis(project, tmp_path / "out")
    written = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))
    hold = written["recordings"]["hold"]
    assert hold == "linear" and any(f'hold = "{hold}"' in each for each in said["says"]), said["says"]
