"""`firmloop init` on a column without a unit that integrates its drive, such as counts of an encoder: a position."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

ROWS, STEP = 3000, 1e-3


def logged(names: tuple[str, str], columns: tuple[np.ndarray, np.ndarray]) -> None:
    rows = [f"{k},{u:.6g},{y:.9g}" for k, (u, y) in enumerate(zip(*columns, strict=True))]
    Path("log.csv").write_text("\n".join([",".join(("ms", *names)), *rows, ""]))


def pushed() -> np.ndarray:
    return np.repeat(np.random.default_rng(5).integers(-255, 256, ROWS // 100), 100).astype(float)


def turned(gain: float = 1300.0, lag: float = 0.05) -> np.ndarray:
    """Return the counts of a shaft whose speed lags behind a duty."""
    place, speed, counts = 0.0, 0.0, []
    for u in pushed():
        counts.append(np.floor(place))
        place += STEP * speed
        speed += (1.0 - np.exp(-STEP / lag)) * (gain * u - speed)
    return np.array(counts)


@pytest.mark.parametrize("name", ["counts", "encoder_ticks", "pos", "y", "qei"])
def test_what_integrates_without_a_unit_is_a_position(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    logged(("pwm", name), (pushed(), turned()))
    assert main(["init", "log.csv"]) == 0
    said = capsys.readouterr().out
    plant = tomllib.loads(Path("log.toml").read_text())["plant"]
    assert (plant["kind"], plant["input"], plant["outputs"]) == ("rotary_stage", "pwm", ["position_rad"])
    assert plant["parameters"]["b_N_m_s_rad"]["value"] == pytest.approx(1.0 / 0.05, rel=0.03)
    assert plant["parameters"]["torque_per_unit"]["value"] == pytest.approx(1300.0 / 0.05, rel=0.03)
    assert (
        "no unit in the file: taken as rad" in said and "of counts give the scale 6.283185307 / counts a turn" in said
    )


@pytest.mark.parametrize("lag", [0.05, 2.0])
def test_counts_that_settle_are_no_position(lag: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    level, counts = 0.0, []
    for u in pushed():
        counts.append(np.floor(level))
        level += (1.0 - np.exp(-STEP / lag)) * (40.0 * u - level)
    logged(("pwm", "counts"), (pushed(), np.array(counts)))
    assert main(["init", "log.csv"]) == 0
    plant = tomllib.loads(Path("log.toml").read_text())["plant"]
    assert plant["outputs"] == ["counts"]
    assert plant["parameters"]["gain"]["value"] == pytest.approx(40.0, rel=0.1)


def test_what_integrates_in_another_unit_is_not_to_be_detrended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    logged(("pwm", "tank_Pa"), (pushed(), turned() / 1e3))
    assert main(["init", "log.csv"]) == 2
    said = capsys.readouterr().err
    assert "no plant kind fits pwm -> tank_Pa: tank_Pa goes on rising or falling where pwm stays" in said
    assert "rotary_stage and linear_stage" in said and "detrend" not in said


def test_a_reading_that_only_sums_up_asks_for_no_controller_slower_than_the_recording(tmp_path: Path) -> None:
    """A way that a vehicle has gone, logged for a second: a controller of 1,000 s was written."""
    time = np.arange(600) * 0.002
    drive = np.repeat(np.random.default_rng(4).choice([0.0, 0.1, -0.15, 0.25], 20), 30)
    log = tmp_path / "drive.csv"
    rows = [f"{t:.3f},{u:.3f},{k}" for k, (t, u) in enumerate(zip(time, drive, strict=True))]
    log.write_text("\n".join(["time_s,duty_cycle,tacho_m", *rows]) + "\n")
    assert main(["init", str(log), "--out", str(tmp_path / "drive.toml")]) == 0
    period = tomllib.loads((tmp_path / "drive.toml").read_text())["controller"]["period_s"]
    assert 0.002 <= period <= time[-1] / 50.0
