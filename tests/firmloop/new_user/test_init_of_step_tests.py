"""`firmloop init` on step tests, one recording for each level: the column that is constant in each is the input."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

TIME = 0.01 * np.arange(300)
GAIN, LAG = 0.15, 0.2
LEVELS = (20.0, -40.0, 60.0, 100.0)


def speed(level: float, seed: int) -> np.ndarray:
    return GAIN * level * (1.0 - np.exp(-TIME / LAG)) + np.random.default_rng(seed).normal(0.0, 0.02, len(TIME))


def logged(name: str, header: str, columns: Sequence[np.ndarray]) -> str:
    rows = (",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
    Path(name).write_text("\n".join([header, *rows, ""]))
    return name


def steps(header: str = "time_s,duty_pct,speed_rad_s", *more: tuple[float, ...]) -> list[str]:
    made = []
    for k, level in enumerate(LEVELS):
        columns = [TIME, 0.0 * TIME + level, speed(level, k), *(0.0 * TIME + each[k] for each in more)]
        made.append(logged(f"s{k}.csv", header, columns))
    return made


def plant(files: list[str]) -> dict[str, object]:
    assert main(["init", *files, "--out", "guess.toml"]) == 0
    return tomllib.loads(Path("guess.toml").read_text())["plant"]


def test_a_duty_that_is_constant_in_each_step_is_the_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    found = plant(steps())
    assert (found["input"], found["outputs"]) == ("duty_percent", ["speed_rad_s"])
    assert found["parameters"]["gain"]["value"] == pytest.approx(GAIN, rel=0.02)
    assert found["parameters"]["time_constant_s"]["value"] == pytest.approx(LAG, rel=0.1)
    assert "never changes" not in capsys.readouterr().out
    assert main(["identify", "guess.toml", "--out", "out"]) == 0
    assert "in every row" not in capsys.readouterr().out


def test_what_is_read_once_in_each_recording_is_neither_input_nor_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    found = plant(steps("time_s,duty_pct,speed_rad_s,temperature_C", (20.0, 21.5, 23.0, 24.0)))
    assert (found["input"], found["outputs"]) == ("duty_percent", ["speed_rad_s"])
    assert "column temperature_C only differs from recording to recording" in capsys.readouterr().out


def test_what_changes_within_a_recording_drives_before_a_level_of_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made = []
    for k, load in enumerate((0.1, 0.3)):
        drive, turning = np.repeat(np.array([0.0, 6.0, -4.0, 8.0, 2.0, 0.0]), 50), [0.0]
        for u in drive[:-1]:
            turning.append(turning[-1] + (1.0 - np.exp(-0.01 / LAG)) * (5.0 * u - turning[-1]))
        columns = [TIME, drive, np.array(turning), 0.0 * TIME + load]
        made.append(logged(f"l{k}.csv", "time_s,drive,speed_rad_s,torque_N_m", columns))
    assert plant(made)["input"] == "drive"


@pytest.mark.parametrize(
    ("answer", "says"),
    [("y", "two columns that change besides the time"), ("ch2", "no column changes within any recording but what dri")],
)
def test_a_level_of_each_recording_alone_has_no_answer(
    answer: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    zero = np.zeros(len(TIME))
    made = [logged(f"n{k}.csv", f"time_s,u_V,{answer}", [TIME, zero + k, zero + 2.0 * k]) for k in range(3)]
    assert main(["init", *made]) == 2
    assert says in capsys.readouterr().err


def test_a_clock_without_a_name_of_time_is_told_by_the_name_it_needs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    logged("log.csv", "x1,u,y", [TIME, np.where(TIME < 1.0, 0.0, 2.0), speed(20.0, 1)])
    assert main(["init", "log.csv"]) == 2
    assert "if x1, which rises in every row, is it, call it time_s in the header" in capsys.readouterr().err
