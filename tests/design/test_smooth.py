"""The smooth equations of a predictive controller are the simulator's where nothing jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmloop.design.models.smooth import smooth_rate
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse, Plant

MASS, FAST = 2.0, 0.5  # kg, m/s: far beyond the speed within which a friction changes its sign


def added(name: str, values: dict[str, float], position: float, speed: float) -> float:
    """Return the force that an effect adds on a linear axis."""
    bare = make_plant("linear_stage", "force_N", ["position_m"], {"mass_kg": MASS, "b_N_s_m": 0.3})
    plant = with_effects(bare, [EffectUse(name, None, values, ())])
    at = [position if signal.unit == "m" else speed for signal in plant.states]

    def rate(of: Plant) -> np.ndarray:
        return np.array(smooth_rate(of, 1e-3).rate(at, 0.0)).ravel()

    return float((rate(plant) - rate(bare))[[s.unit for s in plant.states].index("m/s")]) * MASS


def test_cogging_on_a_linear_axis_counts_periods_a_metre() -> None:
    values = {"amplitude_N": 3.0, "periods_per_m": 40.0, "phase_rad": 0.2}
    for position in (0.0, 0.003, 0.011):
        wanted = -3.0 * math.sin(2 * math.pi * 40.0 * position + 0.2)
        assert added("cogging_torque", values, position, FAST) == pytest.approx(wanted)


def test_every_dry_friction_holds_back_in_both_directions() -> None:
    uneven = {"positive_N": 1.0, "negative_N": 2.0}
    stribeck = {"coulomb_N": 1.0, "static_N": 3.0, "stribeck_m_s": 0.01}
    for sign in (1.0, -1.0):
        assert added("coulomb_friction", {"force_N": 1.5}, 0.0, sign * FAST) == pytest.approx(-1.5 * sign)
        assert added("stribeck_friction", stribeck, 0.0, sign * FAST) == pytest.approx(-sign)
    assert added("asymmetric_friction", uneven, 0.0, FAST) == pytest.approx(-1.0)
    assert added("asymmetric_friction", uneven, 0.0, -FAST) == pytest.approx(2.0)
