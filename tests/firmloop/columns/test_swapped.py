"""Two columns that bear each other's name are told, with the lines that exchange them, and nothing that follows."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.host.identify_faults import exchanged, heater, motor, stage, swing
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, seeded, written

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


@pytest.mark.parametrize("other", ["heater_percent", "temperature_C"])
def test_a_time_under_another_name_is_told(other: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = written(tmp_path / "log", exchanged(heater(seeded(1)), "time_s", other))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 2
    said = capsys.readouterr().err
    assert f"the column {other} does, by " in said and f"exchange the names time_s and {other}" in said, said
