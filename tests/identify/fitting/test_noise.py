"""Noise models find the memory that is there, and none where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from firmloop.identify.fitting.noise import fit_noise, lagged_products, memory, whiteness


def test_white_noise_has_no_memory() -> None:
    noise = np.random.default_rng(1).normal(0.0, 2.0, 4000)
    found = fit_noise([noise], 0.0)
    assert len(found.coefficients) == 0
    assert abs(found.scale - 2.0) < 0.1


def test_colored_noise_is_whitened() -> None:
    source = np.random.default_rng(2).normal(0.0, 0.5, 4000)
    colored = lfilter([1.0], [1.0, -0.95], source)
    found = fit_noise([colored], 0.0)
    assert abs(found.scale - 0.5) < 0.03
    assert found.rms > 1.2
    assert whiteness([colored], 20) < 1e-6
    assert whiteness([found.whiten(colored)[50:]], 20) > 1e-3


def test_coefficients_that_whiten_a_constant_are_counted() -> None:
    """They are as many as it takes to follow a mean, and an offset that explains it needs none of them."""
    source = np.random.default_rng(5).normal(0.0, 1.0, 5000)
    with_constant, without = (fit_noise([source + constant], 0.0) for constant in (2.0, 0.0))
    assert len(with_constant.coefficients) > 12 and len(without.coefficients) == 0
    spared = 2.0 * 5000 * np.log(with_constant.scale / without.scale)
    assert with_constant.unlikely(5000) - without.unlikely(5000) > spared + 100.0


@pytest.mark.parametrize("rate", [0.5, 1.0, 3.0])
def test_what_dies_out_is_no_error(rate: float) -> None:
    """Rows that only rounding tells apart make no order of their own."""
    found = fit_noise([np.exp(-rate * np.arange(5000))], 1e-15)
    assert np.isfinite(found.scale) and np.all(np.isfinite(found.coefficients))
    assert found.scale < 1e-6


def test_resolution_is_the_least_noise() -> None:
    assert fit_noise([np.zeros(500)], 0.01).scale == 0.01


def test_sums_of_products_are_those_of_the_lagged_columns() -> None:
    walk = np.cumsum(np.random.default_rng(3).normal(size=300))
    most = 24
    lagged = np.lib.stride_tricks.sliding_window_view(walk, most + 1)[:, ::-1]
    assert np.allclose(lagged_products(walk, most), lagged.T @ lagged, rtol=1e-12)


def test_rows_that_count_as_one() -> None:
    source = np.random.default_rng(4).normal(size=40000)
    assert abs(memory([source]) - 1.0) < 0.05
    slow = np.asarray(lfilter([1.0], [1.0, -0.9], source))
    assert abs(memory([slow]) / (1.0 + 2.0 * 0.81 / (1.0 - 0.81)) - 1.0) < 0.15  # rho^k = 0.9^k


def test_noise_of_a_diverged_simulation_is_infinite() -> None:
    found = fit_noise([np.ones(500), np.full(500, np.nan)], 0.01)
    assert found.scale == np.inf and found.rms == np.inf
