"""A spring is asked for where a machine comes back: what only goes on winds it up for ever, as a drift does."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.identify.recordings.recording import make_recording, write_recording
from tests.diagnose.cases import lag_project, said_of

STEP = 0.02
ROWS = 1500


def _wheel(folder: Path, lowest: float) -> Path:
    """Drive a wheel by steps from `lowest` V to 5 V, under a load that grows to 0.3 V up to the last row."""
    rng, speed, read = np.random.default_rng(2), 0.0, []
    drive = np.repeat(rng.choice(np.linspace(lowest, 5.0, 5), ROWS // 50), 50)
    for k in range(ROWS):
        read.append(speed)
        speed += STEP * (40.0 * (drive[k] - 0.3 * k / ROWS) - speed) / 0.3
    columns = {"voltage_V": drive, "speed_rad_s": np.array(read) + rng.normal(0.0, 0.3, ROWS)}
    write_recording(make_recording(STEP * np.arange(ROWS), columns, "log.csv", ""), folder / "log.csv")
    (folder / "project.toml").write_text(lag_project("voltage_V", "speed_rad_s", 38.0, 0.35, ("log.csv",)))
    return folder / "project.toml"


def test_a_wheel_that_only_goes_on_has_no_spring_to_where_it_began(tmp_path: Path) -> None:
    """It had one, certain to 100 %."""
    said = said_of(_wheel(tmp_path, 1.0))
    assert not {each["name"] for each in said["effects"]} & {"return_spring", "hardening_spring"}
    assert "never comes back" in said["untestable"]["return_spring"]


def test_a_wheel_that_comes_back_may_have_one(tmp_path: Path) -> None:
    assert "return_spring" not in said_of(_wheel(tmp_path, -5.0))["untestable"]
