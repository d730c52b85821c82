"""A number that stands for no reading is told as one, in every verb, however many rows hold it."""

from __future__ import annotations

import numpy as np
import pytest

from bench.host.identify_faults import changed, motor
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, logged, seeded, written


def lost(signal, wrong, rows=slice(700, 790)):
    def failed(values):
        return np.where(np.isin(np.arange(len(values)), np.arange(len(values))[rows]), wrong, values)

    return changed(motor(seeded(9), rows=1000), **{signal: failed})


SLOW = [pytest.param(*each, marks=pytest.mark.slow) for each in (("voltage_V", -9999.0), ("current_A", -32768.0))]


@pytest.mark.parametrize(("signal", "wrong"), [("speed_rad_s", 65535.0), *SLOW])
def test_a_tenth_of_the_rows_without_a_reading_is_told_and_nothing_that_follows(signal, wrong, tmp_path, capsys):
    says, _ = identified(written(tmp_path / "log", lost(signal, wrong)), capsys)
    assert len(says) == 1 and f"{signal} of log.csv reads {wrong:g} at 0.7 s" in says[0], says
    assert "89 more such" in says[0] and "delete the rows" in says[0]


def test_a_fit_that_diverges_on_a_failed_reading_says_so_and_not_that_the_plant_may_be_unstable(tmp_path, capsys):
    folder = written(tmp_path / "log", lost("voltage_V", 1e30, slice(700, 703)))
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 2
    said = capsys.readouterr().err
    assert "voltage_V of log.csv reads 1e+30 at 0.7 s" in said and "unstable" not in said


@pytest.mark.parametrize("alone", [False, True])
def test_a_prediction_from_a_failed_input_says_so(alone, tmp_path, capsys):
    table, time, columns = lost("voltage_V", 65535.0, slice(700, 703))
    folder = written(tmp_path / "log", (table, time, columns))
    kept = {name: values for name, values in columns.items() if name == "voltage_V" or not alone}
    logged(folder / "log.csv", time, kept)
    words = ["simulate", str(folder / "project.toml"), str(folder / "log.csv"), "--out", str(folder / "seen.csv")]
    assert main(words) == 0
    assert "note: voltage_V of log.csv reads 65535 at 0.7 s" in capsys.readouterr().out


def test_a_prediction_from_a_push_without_other_columns_is_not_complained_of(tmp_path, capsys):
    table, time, columns = motor(seeded(9), rows=1000)
    folder = written(tmp_path / "log", (table, time, columns))
    push = np.where((np.arange(1000) > 700) & (np.arange(1000) < 704), 24.0, np.where(np.arange(1000) > 300, 1.0, 0.0))
    logged(folder / "log.csv", time, {"voltage_V": push})
    words = ["simulate", str(folder / "project.toml"), str(folder / "log.csv"), "--out", str(folder / "seen.csv")]
    assert main(words) == 0
    assert "note:" not in capsys.readouterr().out
