"""Smoothing and fine grids give noise a memory, which is not held against a model that is right."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from firmloop.identify.fitting.fit import fit
from firmloop.identify.fitting.redraw import left_over
from firmloop.identify.fitting.residual_tests import residual_tests
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import conditioning_from_table
from firmloop.identify.recordings.recording import make_recording

PERIOD, ROWS = 0.01, 400
TIME = PERIOD * np.arange(ROWS)
DRIVE = np.repeat(np.random.default_rng(1).choice([-3.0, 3.0], ROWS // 20), 20)
CONDITIONINGS = [
    {"savgol_window": 11},
    {"savgol_window": 31, "savgol_order": 3},
    {"resample_s": 0.004},
    {"resample_s": 0.005, "savgol_window": 9, "remove_offset": ["speed_rad_s"]},
]


def explained(below: list[float], conditioning: dict[str, object], seed: int) -> bool:
    """Fit a first-order lag to what 1/`below` answers, and tell whether nothing is left over."""
    (above,), below_z, _ = scipy.signal.cont2discrete(([2.0], below), PERIOD)
    noise = np.random.default_rng(seed).normal(0.0, 0.1, ROWS)
    columns = {"voltage_V": DRIVE, "speed_rad_s": scipy.signal.lfilter(above, below_z, DRIVE) + noise}
    recording = make_recording(TIME, columns, "run", "")
    table = {"gain": 1.5, "time_constant_s": 0.15, "delay_s": {"value": 0.0, "free": False}}
    how = conditioning_from_table(conditioning)
    found = fit(make_plant("first_order", "voltage_V", ["speed_rad_s"], table), [recording], [], how)
    ((left, drive),) = left_over(found, [recording], how)
    return residual_tests(left[:, 0], drive[:, 0]).explained


FEW = pytest.param(12, id="few")
MANY = pytest.param(100, id="many", marks=pytest.mark.slow)


@pytest.mark.parametrize("conditioning", CONDITIONINGS)
@pytest.mark.parametrize("draws", [FEW, MANY])
def test_a_right_model_is_accepted(conditioning: dict[str, object], draws: int) -> None:
    accepted = sum(explained([0.1, 1.0], conditioning, seed) for seed in range(draws))
    assert accepted >= 0.95 * draws


@pytest.mark.parametrize("conditioning", CONDITIONINGS)
def test_a_wrong_model_is_still_found(conditioning: dict[str, object]) -> None:
    """A second time constant, a third of the first one."""
    assert not any(explained([0.003, 0.13, 1.0], conditioning, seed) for seed in range(3))
