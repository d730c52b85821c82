"""What each parameter moves alone, and what it has a part in: known on paper for a product of two."""

from __future__ import annotations

import pytest

from firmloop.identify.bench_tests.sensitivity import sensitivity
from firmloop.identify.plants.plant_table import plant_from_table

WIDE = {"value": 1.0, "free": True, "low": 0.1, "high": 1.9, "ci95": [0.1, 1.9]}


def test_a_product_of_two_is_shared_as_on_paper() -> None:
    """x rests at one times two, each even over 1 +- a: alone 1 of 2 + a^2/3 of the variance, a^2/3 of it together."""
    plant = plant_from_table(
        {
            "kind": "ode",
            "states": ["speed_rad_s"],
            "inputs": ["voltage_V"],
            "outputs": {"speed_rad_s": "speed_rad_s"},
            "derivatives": {"speed_rad_s": "one*two*voltage_V - speed_rad_s"},
            "parameters": {"one": WIDE, "two": WIDE},
        }
    )
    found = sensitivity(plant, 1.0, 1)
    shared = 0.9**2 / 3
    for name in ("one", "two"):
        low, high = found.ranges[name]
        assert (low, high) == pytest.approx((0.1, 1.9), rel=1e-3)
        assert found.first["final"][name] == pytest.approx(1 / (2 + shared), abs=0.05)
        assert found.total["final"][name] == pytest.approx((1 + shared) / (2 + shared), abs=0.05)
