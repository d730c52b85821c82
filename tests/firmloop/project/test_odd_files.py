"""Files and names that no project has: links in circles, pipes, devices, names too long or in no encoding."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from firmloop.cli import main

EXAMPLE = Path(__file__).parents[3] / "examples" / "wheel_speed"
EXPERIMENT = """
[experiment]
signal = "prbs"
low = -6
high = 6
period_s = 0.01
duration_s = 2
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for recording in EXAMPLE.glob("*.csv"):
        (tmp_path / recording.name).write_bytes(recording.read_bytes())
    (tmp_path / "circle.csv").symlink_to(tmp_path / "circle.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "x.toml").write_text((EXAMPLE / "wheel_speed.toml").read_text() + EXPERIMENT)
    return tmp_path / "x.toml"


@pytest.mark.parametrize("key", ["steps.csv", "ramp.csv"])
@pytest.mark.parametrize("name", ["circle.csv", "pipe.csv", f"{'n' * 300}.csv", "/dev/zero", ".", "a\\u0000b.csv"])
def test_a_recording_that_is_no_file(key: str, name: str, project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project.write_text(project.read_text().replace(f'"{key}"', f'"{name}"'))
    assert main(["identify", str(project), "--out", str(project.parent / "out")]) == 2
    said = capsys.readouterr().err
    assert name[:200] in said or ("train" if key == "steps.csv" else "test") in said
    assert "internal" not in said and len(said.splitlines()) == 1


@pytest.mark.parametrize("name", ["circle.csv", "pipe.csv", "/dev/zero", "n" * 300, "x.toml/x"])
def test_a_project_that_is_no_file(name: str, project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["excite", str(project.parent / name), "--out", str(project.parent / "out")]) == 2
    assert name in capsys.readouterr().err


PLACES = ["circle.csv", "pipe.csv", "n" * 300, "n" * 250, "x.toml/x", "circle.csv/x", "a/" * 3000]


@pytest.mark.parametrize("name", PLACES)
def test_a_place_that_cannot_be_one(name: str, project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["excite", str(project)], ["simulate", str(project), str(project.parent / "circle.csv")]):
        assert main([*command, "--out", str(project.parent / name)]) == 2
        assert "internal" not in capsys.readouterr().err


def test_names_in_no_encoding(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Linux takes any bytes as a name; a file in UTF-8 cannot repeat them."""
    odd = project.parent / "\udcfe"
    odd.mkdir()
    for file in project.parent.glob("[!cp]*.*"):
        file.rename(odd / file.name)
    (project.parent / "prbs.csv").rename(odd / "prbs.csv")
    assert main(["excite", str(odd / "x.toml"), "--out", str(odd / "\udcff")]) == 0
    assert main(["identify", str(odd / "x.toml"), "--out", str(project.parent / "out")]) == 2
    assert "is not UTF-8" in capsys.readouterr().err


@pytest.mark.parametrize(("above", "status"), [(20_000, 0), (210_000, 2)])
def test_lines_above_a_header_are_looked_at_for_seconds_and_no_longer(
    project: Path, above: int, status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A few million of them took minutes."""
    ramp = project.parent / "ramp.csv"
    ramp.write_text("# boot\n" * above + ramp.read_text())
    project.write_text(project.read_text().partition("[experiment]")[0])
    assert main(["simulate", str(project), str(ramp), "--out", str(project.parent / "shown.csv")]) == status
    assert "internal" not in capsys.readouterr().err


def test_what_is_to_be_pasted_keeps_a_line_that_is_parted_otherwise(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = project.parent / "steps.csv"
    steps.write_text("time_s,voltage\u2028V,speed_rad_s\n" + "".join(f"{k},0,0\n" for k in range(20)))
    project.write_text(project.read_text().partition("[experiment]")[0])
    assert main(["identify", str(project), "--out", str(project.parent / "out")]) == 2
    assert '  "voltage\\u2028V" = { name' in capsys.readouterr().err
