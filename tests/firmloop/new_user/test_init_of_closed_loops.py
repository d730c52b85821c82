"""`firmloop init` on the log of a loop: the controller's output drives the plant, what was asked for stays aside."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

STEP = 0.5


def loop(asked: np.ndarray, gain: float = 1.0, lag: float = 20.0, rest: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """Return what a PI controller sends, 0 to 100, and what it reads of a heater."""
    random = np.random.default_rng(3)
    level, total = 0.0, 0.0
    sent, read = np.zeros(len(asked)), np.zeros(len(asked))
    for k, goal in enumerate(asked):
        read[k] = rest + level + random.normal() * 0.05
        total += STEP * 0.1 * (goal - read[k])
        sent[k] = min(max(2.0 * (goal - read[k]) + total, 0.0), 100.0)
        total = min(max(total, 0.0), 100.0)
        level += (1.0 - np.exp(-STEP / lag)) * (gain * sent[k] - level)
    return sent, read


HEADERS = (  # what was asked for, what is read, what is sent
    ("setpoint_C", "temp_C", "output_percent"),
    ("setpoint", "temp", "out"),
    ("set_point", "temperature", "output"),
    ("Set Temp", "Temp", "PID Output"),
    ("sp", "pv", "co"),
    ("SP", "PV", "MV"),
    ("target", "measured", "pwm"),
    ("temp_target", "temp", "heater"),
    ("ref", "y", "u"),
    ("reference", "sensor", "duty"),
    ("cmd", "speed", "pwm"),
    ("command", "output", "duty"),
    ("temp_cmd", "temp", "output"),
    ("soll", "ist", "stellgrad"),
    ("T_soll", "Temperatur", "output (%)"),
    ("setpoint1", "temp1", "out1"),
    ("setpoint", "flow", "controller output"),
)
STILL = HEADERS[:2]  # a setpoint that never changes is one as well


@pytest.mark.parametrize(("names", "still"), [*((each, False) for each in HEADERS), *((each, True) for each in STILL)])
def test_what_a_controller_sends_is_the_input_and_what_was_asked_for_stays_aside(
    names: tuple[str, str, str],
    still: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = np.full(600, 50.0) if still else np.repeat([50.0, 70.0, 40.0, 60.0], 150)
    sent, read = loop(asked)
    columns = {"time_s": STEP * np.arange(600), names[0]: asked, names[1]: read, names[2]: sent}
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True)]
    Path("log.csv").write_text("\n".join([",".join(columns), *rows, ""]))
    assert main(["init", "log.csv"]) == 0
    said = capsys.readouterr().out
    made = tomllib.loads(Path("log.toml").read_text())
    renamed = {
        line["name"] if isinstance(line, dict) else line: name
        for name, line in made["recordings"].get("rename", {}).items()
    }
    driven, (shown,) = made["plant"]["input"], made["plant"]["outputs"]
    assert (renamed.get(driven, driven), renamed.get(shown, shown)) == (names[2], names[1])
    assert f"column {names[0]} " in said and "is not used" in said
    if not still:
        found = made["plant"]["parameters"]
        assert found["gain"]["value"] == pytest.approx(1.0, rel=0.05)
        assert found["time_constant_s"]["value"] == pytest.approx(20.0, rel=0.1)


@pytest.mark.parametrize("names", [("input", "output"), ("u_V", "out"), ("setpoint", "output"), ("cmd", "out")])
def test_an_output_beside_what_drives_or_is_asked_for_is_the_plants(
    names: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sent, read = loop(np.repeat([50.0, 70.0, 40.0, 60.0], 150))
    rows = [f"{STEP * k},{u:.6g},{y:.6g}" for k, (u, y) in enumerate(zip(sent, read, strict=True))]
    Path("log.csv").write_text("\n".join([",".join(("time_s", *names)), *rows, ""]))
    assert main(["init", "log.csv"]) == 0
    assert tomllib.loads(Path("log.toml").read_text())["plant"]["outputs"] == [names[1]]
