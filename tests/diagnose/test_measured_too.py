"""What a diagnosis says of itself: noise, what is still missing, chance, and what was left out of the fit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.diagnose.policy import CHANCE_DRAWS
from tests.diagnose.cases import diagnosis

SCHEMA = Path(__file__).parents[1] / "schema" / "diagnosis.schema.json"
NOISE = 0.3  # rad/s
PROJECT = """schema = 1
name = "lag"
[recordings]
train = {train}
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = {{ value = 19.0, free = true }}
time_constant_s = {{ value = 0.25, free = true }}
delay_s = {{ value = 0.0, free = false }}
"""

Array = NDArray[np.float64]


def _diagnosed(folder: Path, friction: float, pushes: list[Array]) -> dict[str, Any]:
    """Diagnose a motor of gain 20 with dry friction (rad/s), pushed by a disturbance (n,) in rad/s a recording."""
    rng = np.random.default_rng(11)
    step = 0.01
    for k, push in enumerate(pushes):
        rows = len(push)
        drive = np.repeat(rng.uniform(-12.0, 12.0, rows // 30 + 1), 30)[:rows]
        speed = np.zeros(rows)
        for row in range(rows - 1):
            free = speed[row] + step / 0.25 * (20.0 * drive[row] + push[row] - speed[row])
            speed[row + 1] = np.sign(free) * max(abs(free) - step / 0.25 * friction, 0.0)  # at rest it holds
        table = np.column_stack([step * np.arange(rows), drive, speed + rng.normal(0.0, NOISE, rows)])
        head = "time_s,voltage_V,speed_rad_s"
        np.savetxt(folder / f"train_{k}.csv", table, delimiter=",", header=head, comments="")
    names = json.dumps([f"train_{k}.csv" for k in range(len(pushes))])
    (folder / "project.toml").write_text(PROJECT.format(train=names), encoding="utf-8")
    _, said = diagnosis(folder / "project.toml", folder / "out")
    jsonschema.validate(said, json.loads(SCHEMA.read_text(encoding="utf-8")))
    return said


def test_friction_is_no_chance_and_predicts_the_blocks_it_was_not_fitted_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = _diagnosed(tmp_path, 15.0, [np.zeros(900)])
    assert said["verdict"] == "explained"
    assert said["noise"]["speed_rad_s"] == pytest.approx(NOISE, rel=0.08)
    assert said["fit"]["train"]["after"] < 1.3
    crossed = said["simulation_rms"]["cross"]["speed_rad_s"]
    assert crossed["after"] < 1.3 * NOISE < 0.5 * crossed["refit"] < crossed["before"]
    found = said["evidence"]
    assert found["criterion"] == "BIC" and found["gain"] > 200.0 and found["library"] > 5
    assert found["p_value"] == pytest.approx(1.0 / (CHANCE_DRAWS + 1.0))
    (left,) = said["disturbance"].values()
    assert left["unit"] == "rad/s" and left["share_of_drive"] < 0.02
    printed = capsys.readouterr().out
    assert "probability of at most 0.0005" in printed and "left out of the fit" in printed
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "noise of the sensor" in report and "by chance with a probability of" in report


def test_where_nothing_is_missing_chance_would_gain_as_much(tmp_path: Path) -> None:
    said = _diagnosed(tmp_path, 0.0, [np.zeros(400), np.zeros(300)])
    assert said["verdict"] == "no_mismatch" and said["evidence"]["gain"] == 0.0
    assert said["evidence"]["p_value"] > 0.01
    assert said["noise"]["speed_rad_s"] == pytest.approx(NOISE, rel=0.08)
    crossed = said["simulation_rms"]["cross"]["speed_rad_s"]
    assert crossed["after"] == crossed["refit"] == pytest.approx(NOISE, rel=0.1)
    assert all(each["share_of_drive"] < 0.01 for each in said["disturbance"].values())


def test_a_disturbance_is_sized_and_is_no_noise_of_the_sensor(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    push = np.zeros(1500)
    for row in range(1, len(push)):
        push[row] = 0.95 * push[row - 1] + rng.normal(0.0, 12.0 * np.sqrt(1.0 - 0.95**2))
    said = _diagnosed(tmp_path, 0.0, [push])
    assert said["noise"]["speed_rad_s"] == pytest.approx(NOISE, rel=0.15)
    assert said["fit"]["train"]["after"] > 5.0
    (left,) = said["disturbance"].values()
    assert left["rms"] == pytest.approx(np.std(push), rel=0.15)
    assert left["share_of_drive"] == pytest.approx(left["rms"] / (20.0 * 12.0 / np.sqrt(3.0)), rel=0.25)
    assert any("Left beside the white noise of the sensors" in line and "%" in line for line in said["says"])


def test_a_disturbance_that_rivals_the_drive_is_a_finding(tmp_path: Path) -> None:
    push = 150.0 * np.sin(2.0 * np.pi * np.cumsum(np.linspace(0.001, 0.01, 900)))
    said = _diagnosed(tmp_path, 0.0, [push])
    (left,) = said["disturbance"].values()
    assert left["share_of_drive"] > 0.5
    assert any("that is not noise" in line for line in said["says"])
