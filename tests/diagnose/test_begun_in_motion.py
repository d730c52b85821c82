"""Recordings that begin at a steady speed: from rest no simulation of them tells anything."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.diagnose.data.checks import preflight
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import black_box_project, lag_project

LATE, STEP = 0.12, 0.01  # s
PROJECT = lag_project("voltage_V", "speed_rad_s", 25.0, 0.3, ("a.csv", "b.csv"))
STAGE = (
    black_box_project("linear_stage", "voltage_V", "speed_m_s", ("step.csv",))
    + "force_per_unit = 1.0\n[plant.parameters]\n"
    + "mass_kg = { value = 8.0, free = true }\nb_N_s_m = { value = 20.0, free = true }\n"
)


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


@pytest.mark.parametrize("level", [7.0, -7.0])
def test_a_step_whose_first_row_is_missing_tells_of_no_sign(level: float, tmp_path: Path) -> None:
    """A drag that is given at a third of its size has it slow down from the speed where its readings begin."""
    time = STEP * np.arange(300)
    speed = level / 6.0 * (1.0 - 0.6 * np.exp(-time / 0.4)) + 0.001 * np.random.default_rng(6).normal(size=len(time))
    rows = np.column_stack([time, np.full(len(time), level), speed])
    head = "time_s,voltage_V,speed_m_s"
    np.savetxt(tmp_path / "step.csv", rows, delimiter=",", header=head, comments="", fmt="%.7g")
    (tmp_path / "project.toml").write_text(STAGE, encoding="utf-8")
    project = read_project(tmp_path / "project.toml")
    plant, train = plant_of(project), read_data(project).train
    (note,) = preflight(plant, train, []).notes
    assert note.startswith(f"step.csv: voltage_V is {level:g} in every row")
