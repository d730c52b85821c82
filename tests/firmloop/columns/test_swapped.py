"""Two columns that bear each other's name are told, with the lines that exchange them, and nothing that follows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.host.identify_faults import exchanged, heater, held, motor, stage, swing
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, logged, seeded, written

PAIRS = [
    (heater, "heater_percent", "temperature_C"),
    (swing, "valve_V", "level"),
    (motor, "voltage_V", "speed_rad_s"),
    (motor, "speed_rad_s", "current_A"),
    (motor, "voltage_V", "current_A"),
    (stage, "force_N", "position_m"),
]


@pytest.mark.parametrize(("make", "one", "other"), PAIRS)
def test_exchanged_columns_are_told_and_the_lines_that_are_said_mend_them(make, one, other, tmp_path, capsys):
    right = make(seeded(1))
    says, _ = identified(written(tmp_path / "wrong", exchanged(right, one, other)), capsys)
    assert len(says) == 1 and f"{one} and {other} of log.csv look exchanged" in says[0], says
    folder = written(tmp_path / "mended", exchanged(right, one, other))
    project = folder / "project.toml"
    lines = says[0].partition("file on the left, ")[2].replace(" and ", "\n")
    lines = f"[recordings.rename]\n{lines}\n[plant]"
    project.write_text(project.read_text().replace("[plant]", lines, 1))
    assert identified(folder, capsys) == identified(written(tmp_path / "right", right), capsys)


TWO_BODIES = """
schema = 1
name = "bench"
[recordings]
train = ["log.csv"]
[plant]
kind = "ode"
states = ["w1_rad_s", "w2_rad_s", "twist_rad"]
inputs = ["torque_N_m"]
[plant.derivatives]
w1_rad_s = "(torque_N_m - b1_N_m_s_rad*w1_rad_s - k_N_m_rad*twist_rad) / J1_kg_m2"
w2_rad_s = "(k_N_m_rad*twist_rad - b2_N_m_s_rad*w2_rad_s) / J2_kg_m2"
twist_rad = "w1_rad_s - w2_rad_s"
[plant.outputs]
motor_rad_s = "w1_rad_s"
load_rad_s = "w2_rad_s"
[plant.parameters]
J1_kg_m2 = 0.0018
J2_kg_m2 = 0.0044
k_N_m_rad = 8.5
b1_N_m_s_rad = 0.022
b2_N_m_s_rad = 0.018
"""


@pytest.mark.parametrize("wrong", [False, True])
def test_two_bodies_that_move_nearly_alike_and_are_exchanged_are_told(wrong, tmp_path, capsys):
    random, body, other, spring, b = seeded(3), 0.002, 0.004, 8.0, 0.02
    drive = np.repeat(random.choice([-0.4, 0.6], 40), 60)
    a = [[-b / body, 0.0, -1.0 / body], [0.0, -b / other, 1.0 / other], [spring, -spring, 0.0]]
    seen = held(a, [1.0 / body, 0.0, 0.0], np.eye(3)[:2], drive, 0.005) + random.normal(0.0, 0.2, (len(drive), 2))
    names = ("motor_rad_s", "load_rad_s")
    columns = dict(zip(names, seen.T[::-1] if wrong else seen.T, strict=True))
    logged(tmp_path / "log.csv", 0.005 * np.arange(len(drive)), {"torque_N_m": drive, **columns})
    (tmp_path / "project.toml").write_text(TWO_BODIES)
    says, _ = identified(tmp_path, capsys)
    assert len(says) == wrong and all("motor_rad_s and load_rad_s of log.csv look exchanged" in one for one in says), (
        says
    )


def test_a_reading_that_is_logged_as_differences_is_not_called_exchanged(tmp_path, capsys):
    drive = np.resize(np.repeat([0.0, 2.0, 5.0, -3.0, 1.0, 0.0, 4.0], 80), 1200)
    level = held([[-1.0 / 1.5]], [3.0 / 1.5], [[1.0]], drive, 0.05)[:, 0] + seeded(5).normal(0.0, 0.05, len(drive))
    start = {"gain": 2.8, "time_constant_s": 1.7, "delay_s": {"value": 0.0, "free": False}}
    table = {"kind": "first_order", "input": "voltage_V", "outputs": ["temperature_C"], "parameters": start}
    columns = {"voltage_V": drive, "temperature_C": np.diff(level, prepend=0.0)}
    says, _ = identified(written(tmp_path / "log", (table, 0.05 * np.arange(len(drive)), columns)), capsys)
    assert says and not any("exchanged" in one for one in says)


@pytest.mark.parametrize("other", ["heater_percent", "temperature_C"])
def test_a_time_under_another_name_is_told(other: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = written(tmp_path / "log", exchanged(heater(seeded(1)), "time_s", other))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 2
    said = capsys.readouterr().err
    assert f"the column {other} does, by " in said and f"exchange the names time_s and {other}" in said, said
