"""Few independent samples: intervals that hold the truth all the same."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from firmloop.identify.fitting.covariance import uncertainty
from firmloop.identify.normal import NORMAL_95

REPEATS = 40


def held(rows: int, pole: float) -> float:
    """Share of the repeats whose interval of a mean and a slope's mean holds the truth."""
    random = np.random.default_rng(3)
    slopes = np.stack([np.ones(rows), np.linspace(-1.0, 1.0, rows)], axis=1)
    hits = 0
    for _ in range(REPEATS):
        noise = lfilter([1.0], [1.0, -pole], random.normal(0.0, 1.0, 1000 + rows))[1000:]
        found, *_ = np.linalg.lstsq(slopes, noise)
        left = noise - slopes @ found
        weight = 1.0 / np.sqrt(np.mean(left**2))
        sure = uncertainty([1], [weight * left[:, None]], [weight * slopes[:, None]], np.ones(2))
        hits += int(np.sum(np.abs(found) < NORMAL_95 * np.sqrt(np.diag(sure.covariance))))
    return hits / (2 * REPEATS)


@pytest.mark.parametrize(("rows", "pole"), [(10, 0.0), (120, 0.9)])
def test_intervals_hold_the_truth_where_the_noise_is_slow_or_the_rows_are_few(rows: int, pole: float) -> None:
    """Without Student's correction 86 and 69 % do."""
    assert held(rows, pole) >= 0.9


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_intervals_follow_noise_that_is_louder_where_the_slope_is(pole: float) -> None:
    """Slow noise whose size goes with the slope: no stationary one, only the scores' own long run tells."""
    random, rows = np.random.default_rng(4), 3000
    slope = np.sin(np.arange(rows) / 150.0) ** 3
    estimates, said = [], []
    for _ in range(60):
        noise = slope * lfilter([1.0], [1.0, -pole], random.normal(0.0, 1.0, 1000 + rows))[1000:]
        found = float(slope @ noise) / float(slope @ slope)
        left = noise - slope * found
        weight = 1.0 / np.sqrt(np.mean(left**2))
        sure = uncertainty([1], [weight * left[:, None]], [weight * slope[:, None, None]], np.ones(1))
        estimates.append(found)
        said.append(float(np.sqrt(sure.covariance[0, 0])))
    assert np.mean(said) == pytest.approx(np.std(estimates), rel=0.25)


def test_slopes_that_diverge_tell_nothing() -> None:
    """A refit of a stand's whole export had ended in an internal error of a decomposition."""
    slopes = np.ones((50, 1, 2))
    slopes[20:, 0, 1] = np.inf
    found = uncertainty([1], [np.ones((50, 1))], [slopes], np.ones(2))
    assert np.all(np.isnan(found.covariance)) and found.covariance.shape == (2, 2)
