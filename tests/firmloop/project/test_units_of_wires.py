"""A controller and its plant meet in one unit, however it is spelled, or the difference is told with its factor."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from firmloop.cli import main

TANK = """\
schema = 1
name = "loop"
[plant]
kind = "ode"
states = ["level_m"]
inputs = ["{flow}"]
[plant.outputs]
level_m = "level_m"
[plant.derivatives]
level_m = "{flow} / area_m2"
[plant.parameters]
area_m2 = {{ value = 0.4, free = false }}
[controller]
kind = "pid"
period_s = 0.5
kp = 0.02
ki = 0.0004
[signals]
reference = {{ unit = "m", low = 0, high = 2 }}
measurement = {{ unit = "m", low = 0, high = 2 }}
output = {{ unit = "{unit}", low = -0.02, high = 0.02 }}
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""


@pytest.mark.parametrize(
    ("flow", "unit"),
    [
        ("flow_m3_s", "m^3/s"),
        ("flow_m3_s", "m3/s"),
        ("flow_m3_s", "m3_s"),
        ("rate_deg_s", "deg/s"),
        ("inflow_l_min", "l/min"),
        ("torque_N_m", "Nm"),
        ("torque_N_m", "N*m"),
        ("speed_mm_s", "mm/s"),
        ("torque_mN_m", "mNm"),
        ("flow_l_s", "l/s"),
        ("pump_percent", "%"),
        ("flow", "m^3/s"),  # a name that tells no unit
    ],
)
def test_one_unit_in_two_spellings_is_one(flow: str, unit: str, tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(TANK.format(flow=flow, unit=unit))
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "design.json").read_text())


@pytest.mark.parametrize(
    ("flow", "unit", "words"),
    [
        ("flow_m3_s", "l/min", "(1 l/min is 1.66667e-05 m^3/s)"),
        ("flow_m3_s", "s", "in 'm^3/s'; use one unit"),
        ("rate_deg_s", "rad/s", "(1 rad/s is 57.2958 deg/s)"),
        ("rate_deg_s", "s", "in 'deg/s'; use one unit"),
        ("speed_mm_s", "m/s", "(1 m/s is 1000 mm/s)"),
        ("speed_rev_s", "s", "in 'rev/s'; use one unit"),
        ("torque_mN_m", "N*m", "(1 N*m is 1000 mN*m)"),
        ("speed_rad_s", "rpm", "(1 rpm is 0.10472 rad/s)"),
        ("torque_N_m", "mNm", "(1 mNm is 0.001 N*m)"),
    ],
)
def test_two_units_are_told_with_their_factor(
    flow: str, unit: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(TANK.format(flow=flow, unit=unit))
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
