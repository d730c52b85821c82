"""What an input does between its rows is no project's secret: another hold than the given one is said."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from tests.diagnose.cases import diagnosis

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
    table = np.column_stack([step * np.arange(rows), knots, read + rng.normal(0.0, 0.2, rows)])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    (tmp_path / "project.toml").write_text(PROJECT, encoding="utf-8")
    _, said = diagnosis(tmp_path / "project.toml", tmp_path / "out")
    written = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))
    hold = written["recordings"]["hold"]
    assert hold == "linear" and any(f'hold = "{hold}"' in each for each in said["says"]), said["says"]
