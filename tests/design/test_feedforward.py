"""Feedforward from the plant's effects: the input that holds a speed against them, and nothing it cannot know."""

from __future__ import annotations

import numpy as np
import pytest

from design.kinds import design
from design.law import DesignError
from identify.attach import EffectUse, with_effects
from identify.kinds import make_plant
from identify.plant import Plant
from identify.signal import Signal
from quantize.lower import lower
from tests.quantize.test_lower import leaves_bounds
from verify.stimuli import stimuli

MOTOR = {"R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.025, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}
STAND = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
VOLTS = (Signal("output", "V", -12.0, 12.0),)
AHEAD = {"kp": 0.01, "feedforward": {"from": "effects", "smooth": 2.0}}


def plant(*uses: tuple[str, dict[str, float]]) -> Plant:
    bare = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR)
    return with_effects(bare, [EffectUse(name, None, values, ()) for name, values in uses])


def term(machine: Plant, reference: float) -> float:
    """Return what the feedforward adds to a P controller without error."""
    law = design("pid", "x", AHEAD, 0.001, STAND, VOLTS, machine).law
    return float(law.last.function([], [reference, reference])[1])


def test_friction_costs_its_torque_times_r_over_kt() -> None:
    machine = plant(("coulomb_friction", {"torque_N_m": 1e-3}))
    volts = 1e-3 * 8.0 / 0.025
    wanted = {100.0: volts, -3.0: -volts, 1.0: volts / 2, 0.0: 0.0}
    assert [term(machine, w) for w in wanted] == pytest.approx(list(wanted.values()))


def test_directions_load_drag_and_brushes() -> None:
    ohm = 8.0 / 0.025
    uneven = plant(("asymmetric_friction", {"positive_N_m": 1e-3, "negative_N_m": 2e-3}))
    assert (term(uneven, 50.0), term(uneven, -50.0)) == pytest.approx((1e-3 * ohm, -2e-3 * ohm))
    load = plant(("load_torque", {"torque_N_m": -5e-4}))
    assert (term(load, 50.0), term(load, -50.0)) == pytest.approx((-5e-4 * ohm, -5e-4 * ohm))
    drag = plant(("quadratic_drag", {"coefficient_N_m_s2_rad2": 1e-8}))
    assert term(drag, -200.0) == pytest.approx(-1e-8 * 4e4 * ohm)
    assert term(plant(("brush_drop", {"voltage_V": 0.7})), 9.0) == pytest.approx(0.7)


@pytest.mark.parametrize("arithmetic", ["float32", "fixed16"])
def test_bounds_hold_with_an_integral(arithmetic: str) -> None:
    machine = plant(("coulomb_friction", {"torque_N_m": 3e-3}))
    table = {"kp": 0.01, "ki": 2.0, "feedforward": {"from": "effects"}}
    law = design("pid", "x", table, 0.001, STAND, VOLTS, machine).law
    program = lower(law, arithmetic)
    assert leaves_bounds(program, stimuli(program, [], 6000, 5)) == []
    random = np.random.default_rng(1)
    rows = np.repeat(random.choice([-400.0, 0.0, 400.0], (200, 2)), 40, axis=0)
    x = np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[0])
    assert law.state[0].low <= x.min() and x.max() <= law.state[0].high
    assert "coulomb_friction" in law.says


@pytest.mark.parametrize(
    ("table", "machine", "words"),
    [
        ({"from": "effects"}, None, ["nothing to work from", "[[plant.effects]]"]),
        (
            {"from": "effects"},
            plant(("dead_zone", {"half_width_V": 0.2})),
            ["none of the plant's effects", "dead_zone"],
        ),
        ({"from": "effect"}, plant(("load_torque", {"torque_N_m": 1e-4})), ["did you mean 'effects'"]),
        ({"smooth": 1.0}, plant(("load_torque", {"torque_N_m": 1e-4})), ["from", "missing"]),
        ("effects", None, ["not a table"]),
    ],
)
def test_what_cannot_be_met_is_told(table, machine, words) -> None:
    with pytest.raises(DesignError) as caught:
        design("pid", "x", {"kp": 0.01, "feedforward": table}, 0.001, STAND, VOLTS, machine)
    for word in words:
        assert word in str(caught.value)
