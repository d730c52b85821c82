"""What a diagnosis says of a lag: in units of its output, where a step begins, and which few rows a misfit is in."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.identify.recordings.recording import make_recording, write_recording
from tests.diagnose.cases import lag_project, said_of

Array = NDArray[np.float64]


def logged(folder: Path, time: Array, **columns: Array) -> None:
    """Log a drive and an output in train.csv, and write a project of a lag between them."""
    recorded(folder / "train.csv", time, **columns)
    text = lag_project(*columns, 8.0, 4.0, ("train.csv",))
    (folder / "project.toml").write_text(text, encoding="utf-8")


def recorded(file: Path, time: Array, **columns: Array) -> None:
    write_recording(make_recording(time, columns, file.name, ""), file)


@pytest.mark.parametrize(("output", "unit"), [("level_cm", " cm"), ("level", "")])
def test_what_opposes_a_level_is_in_its_unit(output: str, unit: str, tmp_path: Path) -> None:
    rng, step = np.random.default_rng(7), 0.05
    drive = np.repeat(rng.uniform(3.0, 9.0, 15), 60)
    level = np.zeros(len(drive))
    for k in range(len(drive) - 1):  # the pump gives nothing below 2 V
        level[k + 1] = level[k] + step / 4.0 * (8.0 * (drive[k] - 2.0) - level[k])
    columns = {"pump_V": drive, output: level + 0.2 * rng.standard_normal(len(level))}
    logged(tmp_path, step * np.arange(len(level)), **columns)
    said = said_of(tmp_path / "project.toml")
    told = " ".join(said["says"])
    assert "load_torque" in told and "rad" not in told and "N_m" not in told
    assert "shaft" not in told and "torque" not in told.replace("load_torque", "")
    assert all("shaft" not in each["experiment"] for each in said["alternatives"])
    load = next(each for each in said["effects"] if each["name"] == "load_torque")
    assert re.search(rf"\(balance of {output}\): size [\d.-]+ ± [\d.e-]+{unit}\.( |$)", told)
    assert load["parameters"]["torque_N_m"]["unit"] == unit.strip()
    if unit:  # nothing that moves rubs, sticks or has play there
        assert "friction" not in told and "backlash" not in told and "spring" not in told, told


@pytest.mark.parametrize("begins", [0.0, 5.0])
def test_a_step_that_begins_with_its_recording_does_not_move_by_itself(begins: float, tmp_path: Path) -> None:
    time = 0.05 * np.arange(400)
    level = 48.0 + (begins - 48.0) * np.exp(-time / 4.0) + 0.02 * np.random.default_rng(3).standard_normal(len(time))
    logged(tmp_path, time, pump_V=6.0 + 0.0 * time, level_cm=level)
    (note,) = said_of(tmp_path / "project.toml")["notes"]
    assert "train.csv: pump_V is 6 in every row, so that the step itself is not in the file" in note
    assert ("begin there from rest" in note) == (begins == 0.0) and "by itself" not in note


def test_what_comes_on_where_the_input_is_switched_is_no_load(tmp_path: Path) -> None:
    """A second lag was a load of five times the drive, put on in the very row in which the motor was switched on.

    It is switched off in the last row, and two rows are missing.
    """
    time = np.delete(0.02 * np.arange(300), [101, 102])
    since, on = np.maximum(time - 2.04, 0.0), time > 2.03
    speed = np.where(on, 11.6 * (1.0 - 0.3 * np.exp(-since / 0.6)), 0.0)
    read = np.round((speed + np.random.default_rng(0).normal(0.0, 0.1, len(time))) / 0.73) * 0.73 * on
    recorded(tmp_path / "train.csv", time, pump_V=np.where(on & (time < 5.97), 9.0, 0.0), speed_rad_s=read)
    text = lag_project("pump_V", "speed_rad_s", 1.25, 0.125, ("train.csv",))
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert "load_step" not in {each["name"] for each in said["effects"]}


def test_two_readings_that_hold_what_is_missing_are_pointed_at(tmp_path: Path) -> None:
    """Right behind the only step of the input they may be its answer, so that no check refuses them."""
    time = 0.025 * np.arange(320)
    drive, since = np.where(time >= 2.0, 7.0, 0.0), np.maximum(time - 2.0, 0.0)
    level = np.where(time > 2.0, 14.0 * (1.0 - 0.35 * np.exp(-since / 0.12) - 0.08 * np.exp(-since / 2.0)), 0.0)
    level = np.round(level / 0.6 + np.random.default_rng(0).uniform(-0.3, 0.3, len(time)) * (level > 0.0)) * 0.6
    level[[80, 81]] = 21.0, 21.6
    recorded(tmp_path / "train.csv", time, pump_V=drive, speed_rad_s=level)
    text = lag_project("pump_V", "speed_rad_s", 2.0, 0.1, ("train.csv",))
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert said["verdict"] == "unknown_physics"
    assert re.search(r"3 of 320 rows hold [89]\d % .* look whether these readings failed", " ".join(said["says"]))


def test_a_test_recording_that_is_simulated_worse_is_told_with_its_figures(tmp_path: Path) -> None:
    """The brake was off there."""
    rng, step = np.random.default_rng(11), 0.01
    for name, brake in (("train", 15.0), ("test", 0.0)):
        drive = np.repeat(rng.uniform(-12.0, 12.0, 20), 30)
        speed = np.zeros(len(drive))
        for k in range(len(drive) - 1):
            free = speed[k] + step / 0.25 * (20.0 * drive[k] - speed[k])
            speed[k + 1] = np.sign(free) * max(abs(free) - step / 0.25 * brake, 0.0)
        read = speed + rng.normal(0.0, 0.3, len(drive))
        recorded(tmp_path / f"{name}.csv", step * np.arange(len(drive)), pump_V=drive, speed_rad_s=read)
    text = lag_project("pump_V", "speed_rad_s", 19.0, 0.25, ("train.csv",))
    text = text.replace("[plant]", 'test = ["test.csv"]\n[plant]', 1)
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert "coulomb_friction" in [each["name"] for each in said["effects"]]
    stays = next(line for line in said["says"] if line.startswith("The written project is the plain refit"))
    figures = r"simulates test\.csv worse \(speed_rad_s by ([\d.]+) rad/s rms .*, the refit by ([\d.]+) rad/s\)"
    found = re.search(figures, stays)
    assert found and float(found[1]) > float(found[2]), stays
