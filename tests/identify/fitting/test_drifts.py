"""What drifts by itself answers no input, however much of it a few slow features explain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.nulls import colored
from bench.host.identify_faults import changed, motor, swing
from firmloop.cli import main
from firmloop.identify.fitting.checks.structure import Array, Columns, answering, features
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import lag_project, lagged, logged
from tests.firmloop.columns.test_identify_says import written

STEP = 0.01
CASES = 60


def heated(folder: Path, drive: Array) -> tuple[Array, Columns]:
    """Return what a lag of 1.2 s makes of a drive (n,), and the features of its recording (n, f)."""
    clean, time = lagged(drive, 1.2), STEP * np.arange(len(drive))
    text = lag_project("heater_V", "temperature_C", 1.0, 1.2)
    project = read_project(logged(folder, text, "time_s,heater_V,temperature_C", time, drive, clean))
    return clean, features(plant_of(project), read_data(project).train[0], clean[:, None])


def test_a_drift_answers_no_input_and_a_lag_that_is_off_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    drive = np.repeat(rng.uniform(0.0, 5.0, 30), 100)
    clean, given = heated(tmp_path, drive)
    drifts = (np.cumsum(lagged(rng.standard_normal(len(drive)), 3.0)) for _ in range(CASES))
    assert [answering(each, given) for each in drifts] == [0.0] * CASES
    off = lagged(drive, 1.4) - clean
    assert answering(0.1 * off + 0.002 * rng.standard_normal(len(drive)), given) > 0.0


def test_noise_that_grows_towards_slow_answers_an_input_of_few_steps_once_in_a_while(tmp_path: Path) -> None:
    """A few coefficients do not hold the slowest of 1/f noise: every fifth of such had answered the input."""
    rng = np.random.default_rng(7)
    drive = np.repeat(rng.uniform(0.0, 5.0, 10), 300)
    clean, given = heated(tmp_path, drive)
    noises = (colored("one_over_f", len(drive), rng, STEP, 1.0) for _ in range(CASES))
    assert sum(answering(each, given) > 0.0 for each in noises) <= 0.05 * CASES
    off = lagged(drive, 1.4) - clean
    assert answering(4.0 * off / off.std() + colored("one_over_f", len(drive), rng, STEP, 1.0), given) > 0.0


@pytest.mark.parametrize("size", [0.3, 3.0])
def test_a_drift_from_where_a_reading_began_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: float
) -> None:
    """Most of such a ramp is its mean, which is no level at rest: it is the line about it that tells."""
    made = changed(swing(np.random.default_rng(4)), level=lambda v: v + np.linspace(0.0, size, len(v)))
    project = written(tmp_path / "log", made) / "project.toml"
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    assert f"leaves of level drifts by {size:.1g}" in capsys.readouterr().out


@pytest.mark.parametrize(("output", "size"), [("speed_rad_s", 30.0), ("speed_rad_s", 6.0), ("current_A", 0.6)])
def test_a_drift_of_one_output_is_told_beside_the_noise_of_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], output: str, size: float
) -> None:
    """The line was a fifth of all that was left, for the noise of the other output was counted with it."""
    made = changed(motor(np.random.default_rng(4)), **{output: lambda v: v + np.linspace(0.0, size, len(v))})
    project = written(tmp_path / "log", made) / "project.toml"
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 0
    assert f"leaves of {output} drifts by" in capsys.readouterr().out
