"""A reading without its sign gets it back from its slope and from what the plant as given would show."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.diagnose.model.lost_sign import _signs

NOISE = 0.003


def _swings(phase: float) -> NDArray[np.float64]:
    time = np.arange(4000) / 1000.0
    return np.asarray(np.sin(2.0 * np.pi * 1.3 * time + phase) + 0.4 * np.sin(2.0 * np.pi * 3.1 * time))


@pytest.mark.parametrize("size", [0.8, 1.2])
def test_signs_come_back(size: float) -> None:
    true = _swings(0.3)
    seen = np.abs(true + NOISE * np.random.default_rng(1).standard_normal(len(true)))
    signs = _signs(seen, size * _swings(0.5))
    far = np.abs(true) > 5.0 * NOISE
    assert np.array_equal(signs[far], np.sign(true[far]))


def test_a_reading_that_touches_zero_and_turns_stays_on_its_side() -> None:
    time = np.arange(2000) / 1000.0
    true = 1.0 - np.cos(2.0 * np.pi * time)
    seen = np.abs(true + NOISE * np.random.default_rng(2).standard_normal(len(true)))
    signs = _signs(seen, 0.9 * true)
    assert np.all(signs[true > 0.05] == 1.0)
