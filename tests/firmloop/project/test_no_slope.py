"""A plant whose equations divide by 0 is refused with the parameter that is, wherever a loop is closed around it."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.cli import main

TANK = """\
schema = 1
name = "tank"
[plant]
kind = "ode"
states = ["level_m"]
inputs = ["flow_m3_s"]
[plant.outputs]
level_m = "level_m"
[plant.derivatives]
level_m = "flow_m3_s / area_m2"
[plant.parameters]
area_m2 = { value = 0.0, free = false }
[controller]
kind = "pid"
period_s = 0.5
kp = 0.02
ki = 0.0004
[signals]
reference = { unit = "m", low = 0, high = 2 }
measurement = { unit = "m", low = 0, high = 2 }
output = { unit = "m^3/s", low = -0.02, high = 0.02 }
[arithmetic]
number = "float32"
[target]
names = ["host"]
"""


@pytest.mark.parametrize("zero", ["0.0", "-0.0"])
@pytest.mark.parametrize("verb", ["design", "tune"])
def test_a_division_by_a_parameter_that_is_0_names_it(
    verb: str, zero: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(TANK.replace("0.0,", f"{zero},", 1))
    assert main([verb, str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    said = "the derivative of level_m has no finite slope with states and inputs at 0, as if it were divided by 0"
    assert f"{said}; correct area_m2, which is 0" in capsys.readouterr().err


def test_gains_that_are_given_are_generated_whatever_the_plant(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(TANK)
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
