"""A gain of 1 against counts or tenths of a degree is an ordinary start: it hides nothing and explains nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import logged, said_of

PROJECT = """schema = 1
name = "oven"
[recordings]
train = ["log.csv"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]
[plant.parameters]
gain = { value = 1.0, free = true }
time_constant_s = { value = 0.55, free = true }
delay_s = { value = 0.0, free = false }
"""


def test_a_gain_that_is_far_from_its_start_is_found_and_told(tmp_path: Path) -> None:
    """A sensor's gain had been 48 times too large, and the rest unknown."""
    rng, rows, step, gain = np.random.default_rng(0), 1500, 0.01, 2000.0
    drive = np.repeat(rng.uniform(-3.0, 4.0, rows // 75 + 1), 75)[:rows]
    drive[:5] = 0.0
    warm, read = 0.0, np.empty(rows)
    for k in range(rows):
        read[k] = warm
        warm += (1.0 - np.exp(-step / 0.5)) * (gain * drive[k] - warm)
    noisy = read + rng.normal(0.0, 0.01 * gain, rows)
    project = logged(tmp_path, PROJECT, "time_s,voltage_V,temperature_C", step * np.arange(rows), drive, noisy)
    said = said_of(project)
    assert said["verdict"] == "no_mismatch" and not said["effects"], said["says"]
    assert said["shifts"]["gain"]["refit"] == pytest.approx(gain, rel=1e-2)
    assert said["fit"]["train"]["refit"] < 1.1
    assert any("gain = 2e+03, 2e+03 times what the project gives" in each for each in said["says"]), said["says"]


def test_a_gain_that_the_project_gives_no_value_is_not_told_as_so_many_times_it(tmp_path: Path) -> None:
    random, time = np.random.default_rng(3), 0.01 * np.arange(600)
    speed = 0.2 * np.sin(2.0 * np.pi * time)
    force = 5000.0 * np.clip(speed, -0.04, 0.04) + 3.0 * random.normal(size=len(time))
    text = (
        'schema = 1\nname = "damper"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "static"\n'
        'input = "speed_m_s"\noutputs = ["force_N"]\n'
    )
    said = said_of(logged(tmp_path, text, "time_s,speed_m_s,force_N", time, speed, force))
    assert "input_saturation" in {each["name"] for each in said["effects"]}, said["says"]
    assert not any("what the project gives" in each for each in said["says"]), said["says"]
