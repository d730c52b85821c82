"""Of two lags that are hardly told from one another neither is zero, however wide its interval is."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.diagnose.cases import lag_project, logged

PROJECT = (
    lag_project("voltage_V", "speed_rad_s", 20.0, 0.1)
    + '[[plant.effects]]\nname = "sensor_lag"\ntime_constant_s = { value = 0.1, free = true }\n'
)


def test_equal_lags_are_written_as_they_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Beside a slow swing of the load, which no model of this plant makes, they end alike, of endless intervals."""
    time, late = 0.01 * np.arange(1200), 0.17
    passed = np.maximum(time - 3.0, 0.0) / late
    drive = np.where(time < 3.0, 5.0, 15.0)
    speed = 25.0 * (5.0 + 10.0 * (1.0 - (1.0 + passed) * np.exp(-passed)))
    speed += 8.0 * np.sin(0.3 * time) + 0.5 * np.random.default_rng(5).normal(size=len(time))
    project = logged(tmp_path, PROJECT, "time_s,voltage_V,speed_rad_s", time, drive, speed)
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    table = tomllib.loads((tmp_path / "out" / "project.toml").read_text(encoding="utf-8"))["plant"]
    (lag,) = table["effects"]
    for value in (lag["time_constant_s"]["value"], table["parameters"]["time_constant_s"]["value"]):
        assert value == pytest.approx(late, rel=0.1), told
