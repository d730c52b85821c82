"""A value that is given and kept, though the recordings deny it, is named with the one that they ask for."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from bench.host.identify_faults import held, motor, steps
from tests.firmloop.columns.test_identify_says import identified, seeded, written

LATE, LAG, GAIN, LEVEL = 6, 40.0, 0.62, 23.4  # rows of 1 s; s


def oven(kept: float):
    """A heater that answers 6 s late, and a project that keeps another delay."""
    random = seeded(4)
    drive = steps(random, 1500, (0.0, 30.0, 60.0, 100.0), 200)
    late = np.concatenate([np.zeros(LATE), drive[:-LATE]])
    level = held([[-1.0 / LAG]], [[GAIN / LAG]], [[1.0]], late, 1.0).reshape(-1)
    values = {
        "gain": {"value": 0.5, "free": True},
        "time_constant_s": {"value": 50.0, "free": True},
        "delay_s": {"value": kept, "free": False},
        "output_at_rest": {"value": 20.0, "free": True},
    }
    table = {"kind": "first_order", "input": "heater_percent", "outputs": ["temperature_C"], "parameters": values}
    shown = LEVEL + level + 0.05 * random.normal(size=len(drive))
    return table, np.arange(len(drive)) * 1.0, {"heater_percent": drive, "temperature_C": shown}


@pytest.mark.parametrize("kept", [0.0, 1.0, 30.0, 120.0])
def test_a_delay_that_is_kept_too_short_or_too_long_is_told(kept: float, tmp_path: Path, capsys):
    says, _ = identified(written(tmp_path / "log", oven(kept)), capsys)
    assert len(says) == 1 and f"in place of {kept:.4g} s" in says[0], says
    asked = re.search(r"asks for delay_s = ([\d.]+) in place", says[0])
    assert asked and float(asked[1]) == pytest.approx(LATE, abs=0.1)


def test_a_delay_that_is_kept_right_is_met_with_silence(tmp_path: Path, capsys):
    says, found = identified(written(tmp_path / "log", oven(float(LATE))), capsys)
    assert says == [] and found["gain"] == pytest.approx(GAIN, rel=0.01)


@pytest.mark.parametrize("name", ["R_ohm", "L_H"])
def test_a_value_of_another_motor_that_is_kept_is_told(name: str, tmp_path: Path, capsys):
    table, time, columns = motor(seeded(2))
    right = identified(written(tmp_path / "free", (table, time, columns)), capsys)[1]
    parameters = {**table["parameters"], name: {"value": 3.0 * right[name], "free": False}}
    says, _ = identified(written(tmp_path / "kept", ({**table, "parameters": parameters}, time, columns)), capsys)
    asked = re.search(rf"asks for {name} = ([\d.e-]+) in place", " ".join(says))
    assert asked and float(asked[1]) == pytest.approx(right[name], rel=0.02), says
