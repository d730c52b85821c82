"""A heater that is switched on once: its gain and its level of rest are told by where the recording begins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy

import firmloop as fl
from tests.diagnose.cases import lag_project, said_of

GAIN, TIME_CONSTANT_S, AMBIENT_DEGC, ROWS = 0.65, 150.0, 22.0, 600


def heated(
    folder: Path, steps: Sequence[float], before: int = 1, warm: Sequence[float] = (0.0,), second_s: float = 0.0
) -> Path:
    """Write recordings of one row a second: `before` rows off, then on at one level, begun `warm` kelvin above rest."""
    rng, names = np.random.default_rng(2), []
    lags = scipy.signal.lti([GAIN], np.polymul([TIME_CONSTANT_S, 1.0], [second_s, 1.0]))
    for number, (level, above) in enumerate(zip(steps, warm, strict=True)):
        time, percent = np.arange(float(ROWS)), np.where(np.arange(ROWS) < before, 0.0, level)
        after = np.maximum(time - before, 0.0)
        rise = level * np.interp(after, *scipy.signal.step(lags, T=np.linspace(0.0, ROWS, 6001)))
        read = AMBIENT_DEGC + above * np.exp(-time / TIME_CONSTANT_S) + rise + rng.normal(0.0, 0.1, ROWS)
        names.append(f"{number}.csv")
        columns = np.column_stack([time, percent, np.round(read, 1)])
        header = "time_s,heater_percent,temperature_degC"
        np.savetxt(folder / names[-1], columns, delimiter=",", header=header, comments="", fmt="%.6g")
    text = lag_project("heater_percent", "temperature_degC", 0.5, 100, names)
    text += "output_at_rest = { value = 20, free = true }\n"
    (folder / "heater.toml").write_text(text, encoding="utf-8")
    return folder / "heater.toml"


def fitted(project: Path) -> dict[str, tuple[float, float]]:
    found = fl.identify(fl.load(project)).plant.parameters
    return {each.name: (each.value, 1.96 * (each.deviation or np.nan)) for each in found}


@pytest.mark.parametrize("before", [1, 3, 12])
def test_the_gain_of_one_step_is_found_with_its_level_of_rest(before: int, tmp_path: Path) -> None:
    found = fitted(heated(tmp_path, [50.0], before))
    for name, true in (("gain", GAIN), ("output_at_rest", AMBIENT_DEGC), ("time_constant_s", TIME_CONSTANT_S)):
        value, within = found[name]
        assert value == pytest.approx(true, rel=0.01)
        assert abs(value - true) < 2.0 * within


def test_a_second_lag_of_one_step_is_named_and_moves_no_gain(tmp_path: Path) -> None:
    project = heated(tmp_path, [50.0], second_s=20.0)
    assert fitted(project)["gain"][0] == pytest.approx(GAIN, rel=0.15)
    said = said_of(project)
    assert said["verdict"] == "explained"
    assert [effect["name"] for effect in said["effects"]] == ["sensor_lag"]
    assert said["effects"][0]["parameters"]["time_constant_s"]["value"] == pytest.approx(20.0, rel=0.05)


def test_of_steps_that_begin_at_different_temperatures_none_is_taken_to_begin_at_rest(tmp_path: Path) -> None:
    found = fitted(heated(tmp_path, [30.0, 60.0], warm=[0.0, 8.0]))
    assert found["gain"][0] == pytest.approx(GAIN, rel=0.02)
    assert found["output_at_rest"][0] == pytest.approx(AMBIENT_DEGC, abs=0.5)


def test_a_step_from_a_heater_that_was_on_is_told_to_leave_gain_and_rest_to_two_rows(tmp_path: Path) -> None:
    project = heated(tmp_path, [50.0], before=2)
    log = (tmp_path / "0.csv").read_text(encoding="utf-8")
    (tmp_path / "0.csv").write_text(log.replace("\n0,0,", "\n0,20,").replace("\n1,0,", "\n1,20,"), encoding="utf-8")
    (said,) = (each for each in fl.identify(fl.load(project)).fit.warnings if "changes once" in each)
    assert "heater_percent changes once, from 20 to 50 after 2 rows" in said and "output_at_rest" in said


def test_a_heater_that_still_cools_before_its_step_is_not_taken_to_begin_at_rest(tmp_path: Path) -> None:
    found = fitted(heated(tmp_path, [50.0], before=60, warm=[10.0]))
    assert found["output_at_rest"][0] == pytest.approx(AMBIENT_DEGC, abs=1.0)
