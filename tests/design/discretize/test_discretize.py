"""Sampling is exact: compared with python-control on grids fine enough to hold the delay in whole samples."""

from __future__ import annotations

import control
import numpy as np
import pytest

from firmloop.design.discretize.zero_order_hold import state_space, zero_order_hold
from firmloop.design.law import DesignError
from firmloop.identify.simulation.linearize import Linear

A = np.array([[-8000.0, -20.0, 0.0], [6666.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
B = np.array([[1000.0], [0.0], [0.0]])
C = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
PERIOD = 0.001


def fine_grid(linear: Linear, u: np.ndarray, parts: int, delay: int) -> np.ndarray:
    """Outputs just before each sample, from python-control at period / parts with the input moved by `delay` parts."""
    continuous = control.ss(linear.a, linear.b, linear.c, linear.d)
    moved = np.concatenate([np.zeros(delay), np.repeat(u, parts)])[: len(u) * parts]
    time = np.arange(len(moved)) * PERIOD / parts
    x = control.forced_response(control.c2d(continuous, PERIOD / parts, "zoh"), time, moved, return_x=True).states
    before = np.concatenate([[0.0], moved[:-1]])[::parts]
    return (linear.c @ x[:, ::parts]).T + before[:, None] * linear.d.T


@pytest.mark.parametrize("tenths", [0, 3, 10, 25, 40, 47])
@pytest.mark.parametrize("d", [0.0, 0.5])
def test_delay_in_tenths_of_a_sample(tenths, d):
    linear = Linear(A, B, C, np.full((3, 1), d), tenths / 10 * PERIOD)
    sampled = zero_order_hold(linear, PERIOD)
    assert sampled.whole == tenths // 10
    u = np.random.default_rng(3).uniform(-12, 12, 60)
    a, b, c = state_space(sampled)
    x, found = np.zeros(len(a)), []
    for value in u:
        found.append(c @ x)
        x = a @ x + b[:, 0] * value
    expected = fine_grid(linear, u, 10, tenths)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_without_delay_it_is_controls_zero_order_hold():
    sampled = zero_order_hold(Linear(A, B, C, np.zeros((3, 1)), 0.0), PERIOD)
    expected = control.c2d(control.ss(A, B, C, 0), PERIOD, "zoh")
    assert np.allclose(sampled.a, expected.A, rtol=1e-12) and np.allclose(sampled.b_now, expected.B, rtol=1e-12)
    assert not sampled.b_before.any()


def test_a_negative_delay_is_refused():
    with pytest.raises(DesignError, match="negative"):
        zero_order_hold(Linear(A, B, C, np.zeros((3, 1)), -0.1), PERIOD)
