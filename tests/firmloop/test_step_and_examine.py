"""`firmloop step` and `firmloop examine` on repeated trials of one step."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from bench.host.identify_faults import changed, swing
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import written

PROJECT = """\
schema = 1
name = "drum"
[recordings]
train = ["trial1.csv", "trial2.csv", "trial3.csv"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = 1.5
time_constant_s = 0.3
delay_s = { value = 0.0, free = false }
"""


@pytest.fixture
def trials(tmp_path: Path) -> Path:
    folder = tmp_path / "bench"
    folder.mkdir()
    for trial in (1, 2, 3):
        random = np.random.default_rng(trial)
        lines = ["time_s,voltage_V,speed_rad_s"]
        for row in range(400):
            time = row * 0.005
            speed = 18.0 * (1 - np.exp(-max(time - 0.1, 0) / 0.2)) + random.normal(0, 0.1)
            lines.append(f"{time:.3f},{12 if time >= 0.0999 else 0},{speed:.5f}")
        (folder / f"trial{trial}.csv").write_text("\n".join(lines) + "\n")
    path = folder / "drum.toml"
    path.write_text(PROJECT)
    return path


def test_step_says_figures_with_intervals(trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["step", str(trials), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "3 trials" in said and "±" in said and "Sundaresan-Krishnaswamy" in said and "no overshoot" in said
    document = json.loads((tmp_path / "out" / "step.json").read_text())
    assert len(document["trials"]) == 3
    rise = document["over_trials"]["rise_s"]
    assert abs(rise["mean"] - 0.2 * np.log(9)) < max(3 * rise["ci95_half"], 0.01)
    assert document["trials"][0]["models"]["two points"]["time_constant_s"] == pytest.approx(0.2, rel=0.05)
    error = document["over_trials"]["steady_state_error"]  # a gain of 1.5 times 12 V is 18 rad/s
    assert abs(error["mean"]) < 0.05


def test_one_trial_has_the_interval_of_its_noise(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trials.write_text(PROJECT.replace('["trial1.csv", "trial2.csv", "trial3.csv"]', '["trial1.csv"]'))
    assert main(["step", str(trials), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "hold the noise of" in said and "at least 3 of them" in said
    line = next(line for line in said.splitlines() if "two points" in line)
    document = json.loads((tmp_path / "out" / "step.json").read_text())
    half = document["ci95_half_from_noise"]["two points"]["time_constant_s"]
    assert 0.0 < half < 0.02 and f"± {half:.2g} s" in line
    shown = line.split("time_constant_s ")[1].split(" ")[0]
    assert len(shown.partition(".")[2]) <= -np.floor(np.log10(half)) + 1, "no digit beyond the second of the interval"
    assert document["ci95_half_from_noise"]["figures"]["gain"] > 0.0


def test_a_step_that_never_comes(trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = trials.parent / "trial1.csv"
    first.write_text(first.read_text().replace(",12,", ",0,"))
    assert main(["step", str(trials), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "trial1.csv: the step never comes" in said and len(said.splitlines()) == 1


def test_examine_says_how_far_to_trust(trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trials.write_text(PROJECT.replace("[plant]\n", "[recordings.conditioning]\nsavgol_window = 7\n[plant]\n"))
    assert main(["examine", str(trials), "--out", str(tmp_path / "out"), "--draws", "200"]) == 0
    said = capsys.readouterr().out
    for words in ("Monte Carlo (200)", "bootstrap (200)", "white", "share of the variance", "moved by"):
        assert words in said
    document = json.loads((tmp_path / "out" / "examination.json").read_text())
    low, high = document["monte_carlo"]["ci95"]["time_constant_s"]
    assert low < 0.2 < high
    assert document["sensitivity"]["local"]["final"]["gain"] == pytest.approx(1.0, abs=0.02)
    assert set(document["conditioning"]) == {"gain", "time_constant_s"}
    assert (tmp_path / "out" / "project.toml").is_file()


@pytest.mark.parametrize(("made", "verdict"), [(0, ""), (0.9, "noise with a memory"), (0.97, "noise with a memory")])
def test_noise_with_a_memory_is_nothing_that_a_model_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], made: float, verdict: str
) -> None:
    project = written(tmp_path / "log", swing(np.random.default_rng(4), memory=made)) / "project.toml"
    assert main(["examine", str(project), "--out", str(tmp_path / "out"), "--draws", "100"]) == 0
    assert re.search(rf"  mean 0 \S+ *{verdict}\n", capsys.readouterr().out)


BENDS: list[Callable[[np.ndarray], np.ndarray]] = [
    lambda v: v + 0.05 * v * np.abs(v),
    lambda v: v + np.linspace(0.0, 1.0, len(v)),
    lambda v: v + 0.002 * v * np.abs(v),  # less of the residual than noise, and no less sure
    lambda v: scipy.signal.savgol_filter(v + 0.004 * v * np.abs(v), 11, 2),  # a log that was smoothed
]


@pytest.mark.parametrize("bend", BENDS)
def test_what_a_model_lacks_is_no_noise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bend: Callable[[np.ndarray], np.ndarray]
) -> None:
    made = changed(swing(np.random.default_rng(4)), level=bend)
    project = written(tmp_path / "log", made) / "project.toml"
    assert main(["examine", str(project), "--out", str(tmp_path / "out"), "--draws", "100"]) == 0
    assert "NOT all explained" in capsys.readouterr().out


def test_windows_are_examined_of_which_one_has_a_start_without_any_trace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The step of that start was rounding over next to nothing, 1e130, and no refit of any fit by windows settled."""
    folder = written(tmp_path / "log", swing(np.random.default_rng(100), rows=900))
    project = folder / "project.toml"
    project.write_text(project.read_text().replace("[plant]", "[recordings.conditioning]\nwindow_s = 3\n[plant]", 1))
    assert main(["examine", str(project), "--out", str(tmp_path / "out"), "--draws", "100"]) == 0
    said = capsys.readouterr().out
    assert "NOT all explained" not in said
    low, high = json.loads((tmp_path / "out" / "examination.json").read_text())["monte_carlo"]["ci95"]["damping_ratio"]
    assert 0.29 < low < high < 0.31


def test_a_plant_without_a_free_parameter_has_nothing_to_examine(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trials.write_text(
        re.sub(r"^(gain|time_constant_s) = (.*)$", r"\1 = { value = \2, free = false }", PROJECT, flags=re.M)
    )
    assert main(["examine", str(trials), "--out", str(tmp_path / "out"), "--draws", "200"]) == 2
    assert "plant.parameters: none is free, so that there is no interval to examine" in capsys.readouterr().err
    assert not [*(tmp_path / "out").glob("*.json")]


@pytest.mark.parametrize("verb", ["step", "examine"])
def test_an_input_that_saturates_is_said(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    trials.write_text(PROJECT + '[signals]\noutput = { unit = "V", low = -10, high = 10 }\n')
    assert main([verb, str(trials), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "voltage_V of trial1.csv goes to 12 V, but signals.output ends at -10 and 10" in said
    assert len(said.splitlines()) == 1


def noise_alone(trials: Path) -> None:
    """Write the trials anew with an output that does not answer."""
    random = np.random.default_rng(3)
    for path in trials.parent.glob("trial*.csv"):
        lines = path.read_text().splitlines()
        noise = [",".join([*line.split(",")[:2], f"{random.normal():.4f}"]) for line in lines[1:]]
        path.write_text("\n".join([lines[0], *noise]) + "\n")


def test_identify_says_what_a_fit_cannot_mend(trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trials.write_text(PROJECT + '[signals]\noutput = { unit = "V", low = -10, high = 10 }\n')
    assert main(["identify", str(trials), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "note: voltage_V of trial1.csv goes to 12 V, but signals.output ends at -10 and 10" in said


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("identify", "gain cannot be told from 0 (95 % interval -"),
        ("model", "the output does not answer the input: a model of order 2 explains"),
        ("step", "speed_rad_s does not answer the step of voltage_V from 0 to 12"),
    ],
)
def test_an_output_that_does_not_answer_is_refused(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, words: str
) -> None:
    noise_alone(trials)
    assert main([verb, str(trials), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "trial1.csv" in said and words in said and not (tmp_path / "out").exists()


def test_a_kind_that_misses_most_of_the_output_is_said(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A lag on what swings without end: its interval is no use, and nothing else would say so."""
    for path in trials.parent.glob("trial*.csv"):
        rows = [line.split(",") for line in path.read_text().splitlines()]
        swings = [
            ",".join([time, volts, f"{18 * (float(volts) > 0) * (1 - np.cos(30 * (float(time) - 0.1))):.5f}"])
            for time, volts, _ in rows[1:]
        ]
        path.write_text("\n".join([",".join(rows[0]), *swings]) + "\n")
    assert main(["identify", str(trials), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert (
        "note: first_order explains only" in said and "speed_rad_s in trial1.csv, and what is left is no noise" in said
    )


@pytest.mark.parametrize("verb", ["identify", "step", "model"])
def test_an_input_that_never_changes_is_refused(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """It stood at 12 V long before the first row, so that nothing but a gain could be told."""
    noise_alone(trials)
    for path in trials.parent.glob("trial*.csv"):
        path.write_text(path.read_text().replace(",0,", ",12,"))
    assert main([verb, str(trials), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert ("excites 1 directions" if verb == "model" else "voltage_V is 12 in every row") in said


def test_a_negative_gain_is_a_gain(trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in trials.parent.glob("trial*.csv"):
        lines = path.read_text().splitlines()
        turned = [",".join([*line.split(",")[:2], str(-float(line.split(",")[2]))]) for line in lines[1:]]
        path.write_text("\n".join([lines[0], *turned]) + "\n")
    assert main(["step", str(trials), "--out", str(tmp_path / "out")]) == 0
    document = json.loads((tmp_path / "out" / "step.json").read_text())
    assert document["trials"][0]["figures"]["gain"] == pytest.approx(-1.5, rel=0.01)
    assert document["trials"][0]["models"]["63 %"]["time_constant_s"] == pytest.approx(0.2, rel=0.05)
    capsys.readouterr()


@pytest.fixture
def cut_off(trials: Path) -> Path:
    """The first trial ends at 15 rad/s."""
    first = trials.parent / "trial1.csv"
    rows = [line.split(",") for line in first.read_text().splitlines()]
    cut = [",".join([time, volts, f"{min(float(speed), 15.0):.5f}"]) for time, volts, speed in rows[1:]]
    first.write_text("\n".join([",".join(rows[0]), *cut]) + "\n")
    return trials


@pytest.mark.parametrize("verb", ["step", "examine", "model"])
def test_an_output_that_is_cut_off_is_refused(
    cut_off: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    assert main([verb, str(cut_off), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "speed_rad_s of trial1.csv is cut off at 15 rad/s in 7" in said and "record a smaller motion" in said
    assert len(said.splitlines()) == 1 and not (tmp_path / "out").exists()


def test_identify_says_that_an_output_is_cut_off(
    cut_off: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(cut_off), "--out", str(tmp_path / "out")]) == 0
    assert "note: speed_rad_s of trial1.csv is cut off at 15 rad/s" in capsys.readouterr().out
