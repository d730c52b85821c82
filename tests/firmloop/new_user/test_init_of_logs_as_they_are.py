"""`firmloop init` on logs of one heater as programs and people write them: the plant comes out right."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

STEP, LAG, GAIN, REST = 2.0, 150.0, 0.5, 20.0  # s, s, K/%, degC
TIME = STEP * np.arange(1500)
POWER = np.repeat([0.0, 60.0, 100.0, 40.0, 0.0], 300)  # %


def warmed(power: np.ndarray) -> np.ndarray:
    """Return how much warmer than at rest a lag behind a power is, with a little noise."""
    stays, out = np.exp(-STEP / LAG), np.zeros(len(power))
    for k in range(1, len(power)):
        out[k] = stays * out[k - 1] + (1.0 - stays) * GAIN * power[k - 1]
    return out + np.random.default_rng(3).normal(0.0, 0.02, len(power))


HEAT = REST + warmed(POWER)


def rows(header: str, form: Callable[..., str], *columns: np.ndarray) -> str:
    return "\n".join([header, *(form(*row) for row in zip(*columns, strict=True)), ""])


LOGS: dict[str, tuple[str, float]] = {  # and what the gain is times that of % and K
    "days of a spreadsheet, called a date": (
        rows("Date,Heater %,Temp C", lambda t, u, y: f"{45352.375 + t / 86400:.6f},{u:.0f},{y:.3f}", TIME, POWER, HEAT),
        1.0,
    ),
    "days of a spreadsheet, called a time": (
        rows("Time,Heater %,Temp C", lambda t, u, y: f"{45352.375 + t / 86400:.9f},{u:.0f},{y:.3f}", TIME, POWER, HEAT),
        1.0,
    ),
    "days of MATLAB": (
        rows("datenum,u_pct,T_C", lambda t, u, y: f"{739312.5 + t / 86400:.9f},{u:.0f},{y:.3f}", TIME, POWER, HEAT),
        1.0,
    ),
    "Fahrenheit as a letter": (
        rows("minutes,heater,Temp F", lambda t, u, y: f"{t / 60:.4f},{u:.0f},{1.8 * y + 32:.2f}", TIME, POWER, HEAT),
        1.0,
    ),
    "a time that is called by its unit alone": (
        rows("s,heater,temp_C", lambda t, u, y: f"{t:.0f},{u:.0f},{y:.3f}", TIME, POWER, HEAT),
        1.0,
    ),
    "a signal of 4 to 20 mA that rests at 4": (
        rows("t_s,valve_mA,temp_C", lambda t, u, y: f"{t},{4 + 0.16 * u:.3f},{y - REST:.3f}", TIME, POWER, HEAT),
        6250.0,
    ),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_log_gives_the_plant_its_right_values(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    content, scale = LOGS[name]
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(content, encoding="utf-8")
    assert main(["init", "log.csv"]) == 0, capsys.readouterr().err
    plant = tomllib.loads(Path("log.toml").read_text())["plant"]
    values = {key: each["value"] for key, each in plant["parameters"].items()}
    assert plant["kind"] == "first_order" and plant["outputs"] == ["temperature_C"]
    assert values["gain"] == pytest.approx(GAIN * scale, rel=0.01)
    assert values["time_constant_s"] == pytest.approx(LAG, rel=0.01)
    assert values["output_at_rest"] == pytest.approx(0.0 if "4 to 20" in name else REST, abs=0.1)
