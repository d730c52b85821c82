"""Whether a controller made an input, which answers noise, or somebody who knew nothing of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.diagnose.discrepancy.disturbance import made_from

ROWS, STEP_S = 3000, 2e-3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("gain", [0.0, 0.02], ids=["a sweep", "a controller"])
def test_an_input_that_follows_noise_is_told_from_one_that_does_not(seed: int, gain: float) -> None:
    rng = np.random.default_rng(seed)
    time = STEP_S * np.arange(ROWS)
    asked = 5.0 * np.sin(2.0 * np.pi * (0.2 * time + time**2))
    speed, drive, noise = np.zeros(ROWS), np.zeros(ROWS), rng.normal(0.0, 0.3, ROWS)
    for row in range(ROWS - 1):
        drive[row] = asked[row] - gain * (speed[row] + noise[row])
        speed[row + 1] = speed[row] + STEP_S / 0.05 * (20.0 * drive[row] - speed[row])
    assert made_from(drive[:-1], _left(speed + noise, drive)) is (gain > 0.0)


def _left(read: NDArray[np.float64], drive: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a lag that is a tenth too quick leaves of readings."""
    told = np.zeros(ROWS)
    for row in range(ROWS - 1):
        told[row + 1] = told[row] + STEP_S / 0.045 * (20.0 * drive[row] - told[row])
    return (read - told)[:-1, None]
