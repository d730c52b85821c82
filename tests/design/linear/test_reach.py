"""The L1 bound is kept by the input that is worst for it, and is not wider than that input shows."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.design.kinds import design
from firmloop.design.law import DesignError
from firmloop.design.linear.reach import forgets, reach
from firmloop.identify.signal import Signal


def worst(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray, k: int, steps: int) -> float:
    """Drive coordinate k as high as inputs in range can within `steps` samples."""
    response, total, best = b, 0.0, 0.0
    for _ in range(steps):
        total += float(np.sum(np.maximum(response[k] * low, response[k] * high)))
        best = max(best, total)
        response = a @ response
    return best


@pytest.mark.parametrize("radius", [0.3, 0.9, 0.99])
def test_the_bound_is_reached_by_the_worst_input(radius: float) -> None:
    for seed in range(6):
        random = np.random.default_rng(seed)
        n, m = int(random.integers(1, 6)), int(random.integers(1, 4))
        a = random.normal(size=(n, n))
        a *= radius / np.max(np.abs(np.linalg.eigvals(a)))
        b = random.normal(size=(n, m)) * 10.0 ** random.uniform(-6, 6, size=(n, 1))
        low = -(10.0 ** random.uniform(-3, 3, size=m)) if seed % 3 else 10.0 ** random.uniform(-3, 0, size=m)
        high = 10.0 ** random.uniform(0, 3, size=m)
        down, up = reach(a, b, low, high)
        for k in range(n):
            most = worst(a, b, low, high, k, 15 * int(2 / (1 - radius)))
            least = worst(a, -b, low, high, k, 15 * int(2 / (1 - radius)))
            size = max(most, least)
            assert most <= up[k] * (1 + 1e-9) and least <= -down[k] * (1 + 1e-9)
            assert up[k] <= most + 2e-3 * size and -down[k] <= least + 2e-3 * size


def test_a_very_slow_pole_is_bounded_without_walking_its_whole_response() -> None:
    slow = 1 - 1e-9
    down, up = reach(np.array([[slow]]), np.array([[1e-9]]), np.array([-1.0]), np.array([2.0]))
    assert 2.0 <= up[0] < 2.1 and -1.1 < down[0] <= -1.0


def test_no_state_and_no_input() -> None:
    none = np.zeros(0)
    assert reach(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(2), np.ones(2))[0].shape == (0,)
    assert reach(np.eye(2) / 2, np.zeros((2, 0)), none, none)[1].tolist() == [0.0, 0.0]


def test_poles_are_named() -> None:
    assert forgets(np.diag([0.5, -0.9]), "x") and not forgets(np.diag([0.5, 1.0]), "x")
    with pytest.raises(DesignError, match=r"unstable: its poles at z = -1\.25, 1\.01 lie outside"):
        forgets(np.diag([0.5, -1.25, 1.01]), "x")


@pytest.mark.parametrize("slow", [1e-2, 1e-4, 1e-5, 1e-6])
def test_ranges_hold_what_single_precision_adds_up(slow: float) -> None:
    """The coefficient of a slow pole rounds in float32, which moves the pole; a far too slow one has no range."""
    table = {"A": [[1 - slow]], "B": [[slow]], "C": [[1.0]]}
    wires = (Signal("z", "V", -1.0, 1.0),), (Signal("u", "V", -2.0, 2.0),)
    law = design("state_space", "x", table, 0.001, *wires, None).law
    a, b = np.float32(1 - slow), np.float32(slow)
    assert float(b) / (1 - float(a)) <= law.state[0].high
    assert law.state[0].high < 1.2 if slow > 3e-6 else law.state[0].high == np.inf or law.state[0].high < 3.0
