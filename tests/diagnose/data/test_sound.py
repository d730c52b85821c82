"""Channels that no plant could have produced are refused; recordings that contradict each other name nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.cli import main
from firmloop.identify.recordings.recording import make_recording, read_recording, write_recording
from tests.diagnose.cases import concealed

Columns = dict[str, NDArray[np.float64]]


def _spoiled(folder: Path, role: str, change: Callable[[Columns], None]) -> Path:
    """Conceal nothing, then change the columns of one recording."""
    file = concealed(folder, "", 1.0, False)
    path = file.parent / f"{role}.csv"
    recording = read_recording(path, {})
    columns = {name: np.array(values) for name, values in recording.columns.items()}
    change(columns)
    write_recording(make_recording(recording.time, columns, path.name, ""), path)
    return file


def _zero(columns: Columns) -> None:
    columns["speed_rad_s"][:] = 0.0


def _wild(columns: Columns) -> None:
    columns["current_A"][1234] = 900.0


def _dead(columns: Columns) -> None:
    columns["speed_rad_s"][2500:] = 0.0


def _stuck(columns: Columns) -> None:
    columns["speed_rad_s"][2500:] = columns["speed_rad_s"][2500]


def _swapped(columns: Columns) -> None:
    columns["speed_rad_s"], columns["current_A"] = columns["current_A"], columns["speed_rad_s"]


def _rpm(columns: Columns) -> None:
    columns["speed_rad_s"] *= 60.0 / (2.0 * np.pi)


@pytest.mark.parametrize(
    ("role", "change", "words"),
    [
        ("train", _zero, ["speed_rad_s is 0 in every row"]),
        ("train", _wild, ["current_A of train.csv reads 900 at 1.234 s"]),
        ("train", _dead, ["speed_rad_s stands at 0", "2.5 s"]),
        ("test", _stuck, ["speed_rad_s of test.csv stands at"]),
        ("test", _swapped, ["test.csv", "swapped"]),
        ("test", _rpm, ["test.csv", "rpm"]),
    ],
)
def test_it_is_refused_with_a_sentence(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    role: str,
    change: Callable[[Columns], None],
    words: list[str],
) -> None:
    file = _spoiled(tmp_path, role, change)
    assert main(["diagnose", str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in words), said
    assert not (tmp_path / "out").exists()


UNSTABLE = """schema = 1
name = "unstable"
[recordings]
train = ["train.csv"]
[plant]
kind = "ode"
states = ["x_m"]
inputs = ["voltage_V"]
[plant.outputs]
x_m = "x_m"
[plant.derivatives]
x_m = "a*x_m + voltage_V"
[plant.parameters]
a = { value = 900.0, free = true }
"""


def test_a_plant_that_only_its_controller_holds_is_not_said_to_match(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without it a simulation leaves all numbers within a second."""
    grow, wanted = np.exp(0.9), np.repeat(np.random.default_rng(3).uniform(-1.0, 1.0, 20), 50)
    pull = 900.0 / (grow - 1.0)
    place, drive = np.zeros(1000), np.zeros(1000)
    for k in range(999):
        drive[k] = pull * ((0.2 - grow) * place[k] + 0.8 * wanted[k])
        place[k + 1] = grow * place[k] + drive[k] / pull
    columns = {"voltage_V": drive, "x_m": place}
    write_recording(make_recording(np.arange(1000) * 1e-3, columns, "train.csv", ""), tmp_path / "train.csv")
    (tmp_path / "project.toml").write_text(UNSTABLE)
    assert main(["diagnose", str(tmp_path / "project.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "nothing could be compared: simulations diverge" in capsys.readouterr().out


@pytest.mark.slow
def test_a_test_recording_of_another_motor_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def other(columns: Columns) -> None:
        columns["speed_rad_s"] *= 0.6  # its constants are others
        columns["current_A"] = np.roll(columns["current_A"], 40)

    file = _spoiled(tmp_path, "test", other)
    main(["diagnose", str(file), "--out", str(tmp_path / "out")])
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert said["fit"]["test"]["after"] > 10.0 * said["fit"]["train"]["after"]
    assert "check that all are of one plant" in capsys.readouterr().out


STARTED = """schema = 1
name = "started"
[recordings]
train = ["strong.csv", "weak.csv", "held.csv"]
[plant]
kind = "first_order"
input = "duty"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = { value = 60.0, free = true }
time_constant_s = { value = 0.06, free = true }
delay_s = { value = 0.0, free = false }
"""


def _started(folder: Path, weak: float, held: float, dead: bool = True, first: float = 0.0) -> Path:
    """Write what a motor does at three duties from `first`; it starts at 0.3. If `dead`, the third encoder reads 0."""
    (folder / "project.toml").write_text(STARTED)
    noise, time = np.random.default_rng(11), np.arange(500) * 2e-3
    for name, duty in (("strong", 0.9), ("weak", weak), ("held", held)):
        drive = np.where(time < 0.1, 0.0, duty)
        speed = 55.0 * np.sign(duty) * (abs(duty) - 0.3) * -np.expm1(-np.maximum(time - 0.1, 0.0) / 0.05)
        read = 0.0 * time if dead and name == "held" else speed + noise.normal(0.0, 0.2, len(time))
        kept = time >= first
        columns = {"duty": drive[kept], "speed_rad_s": read[kept]}
        write_recording(make_recording(time[kept] - first, columns, name, ""), folder / f"{name}.csv")
    return folder / "project.toml"


def test_a_run_too_weak_to_start_the_motor_is_a_recording_like_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where a larger input moves the same output, friction holds it, and no sensor is dead."""
    main(["diagnose", str(_started(tmp_path, -0.5, 0.2)), "--out", str(tmp_path / "out")])
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert {each["name"] for each in said["effects"]} <= {"dead_zone", "coulomb_friction"} and said["effects"]
    assert main(["identify", str(tmp_path / "project.toml"), "--out", str(tmp_path / "plant")]) == 0
    told = capsys.readouterr().out
    assert "held.csv    speed_rad_s  fit none" in told  # of what never moves there is no share to explain


@pytest.mark.parametrize(("weak", "held", "first"), [(0.6, 0.45, 0.0), (0.8, 0.7, 0.1)])
def test_what_rests_where_it_reads_has_no_level_of_rest(
    weak: float, held: float, first: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A level would make up for friction in the one direction that was recorded; at rest the encoder reads 0.

    Runs that are driven from their first row on, each by another duty, all read 0 there: no level holds them so.
    """
    project = _started(tmp_path, weak, held, dead=False, first=first)
    assert main(["identify", str(project), "--out", str(tmp_path / "plant")]) == 0
    told = capsys.readouterr().out
    assert "before anything drives it: no level at rest, but dry friction" in told and "output_at_rest" not in told


def test_an_output_that_stands_still_at_the_largest_input_is_a_dead_sensor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = _started(tmp_path, -0.5, 1.0)
    assert main(["diagnose", str(project), "--out", str(tmp_path / "out")]) == 2
    assert main(["identify", str(project), "--out", str(tmp_path / "plant")]) == 2
    said = capsys.readouterr().err
    assert "held.csv: column speed_rad_s is 0 in every row" in said and "speed_rad_s never changes" in said
