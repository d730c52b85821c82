"""A plant whose equations divide by 0 is refused with the parameter that is, wherever a loop is closed around it."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.cli import main
from tests.firmloop.project.test_units_of_wires import TANK as LOOP

TANK = LOOP.format(flow="flow_m3_s", unit="m^3/s").replace("value = 0.4,", "value = 0.0,")


@pytest.mark.parametrize("zero", ["0.0", "-0.0"])
@pytest.mark.parametrize("verb", ["design", "tune"])
def test_a_division_by_a_parameter_that_is_0_names_it(
    verb: str, zero: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(TANK.replace("0.0,", f"{zero},", 1))
    assert main([verb, str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    said = "the derivative of level_m has no finite slope with states and inputs at 0, as if it were divided by 0"
    assert f"{said}; correct area_m2, which is 0" in capsys.readouterr().err


def test_gains_that_are_given_are_generated_whatever_the_plant_and_the_loop_is_said_not_to_be_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(TANK)
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "note: whether the loop of this controller around [plant] is stable cannot be told: " in said
    assert "the derivative of level_m has no finite slope" in said and "correct area_m2, which is 0" in said
    (tmp_path / "p.toml").write_text(TANK.replace("value = 0.0,", "value = 0.4,"))
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "cannot be told" not in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["design", "generate"])
def test_a_plant_that_is_not_linear_is_said_to_be_judged_by_its_slopes_at_0(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = TANK.replace("value = 0.0,", "value = 0.4,")
    (tmp_path / "p.toml").write_text(text)
    assert main([verb, str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "not linear" not in capsys.readouterr().out
    (tmp_path / "p.toml").write_text(text.replace(" / area_m2", " / area_m2 - 0.01*sqrt(level_m + 0.1)", 1))
    assert main([verb, str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "the equation of level_m is not linear, and gains and margins rest on" in capsys.readouterr().out
