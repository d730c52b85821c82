"""An effect acts where the project says; the order of lines says nothing."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import places_of, with_effects
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.plant_table import effects_table, plant_from_table
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.superset import superset

TIME = np.arange(800) * 0.005
DRIVE = np.select([TIME < 0.1, TIME < 1.2, TIME < 2.4, TIME < 3.2], [0.0, 3.0, -2.5, 0.4], 0.0)
RUN = make_recording(TIME, {"torque_N_m": DRIVE}, "run.csv", "")
STATES = ("th1", "w1", "th2", "w2")
EQUATIONS = {
    "th1": "w1",
    "w1": "(torque_N_m - 8*(th1 - th2) - 0.3*(w1 - w2) - 0.1*w1) / 0.05",
    "th2": "w2",
    "w2": "(8*(th1 - th2) + 0.3*(w1 - w2) - 0.2*w2) / 0.08",
}
BALANCES = {
    "w1": {"kind": "torque", "per": "1/0.05", "position": "th1", "speed": "w1", "effort": "torque_N_m"},
    "w2": {"kind": "torque", "per": "1/0.08", "position": "th2", "speed": "w2"},
}
VALUES = {
    "coulomb_friction": {"torque_N_m": 0.4},
    "stribeck_friction": {"coulomb_N_m": 0.2, "static_N_m": 0.5, "stribeck_rad_s": 2.0},
    "asymmetric_friction": {"positive_N_m": 0.3, "negative_N_m": 0.1},
    "presliding_friction": {"stiffness_N_m_rad": 40.0, "coulomb_N_m": 0.4},
    "quadratic_drag": {"coefficient_N_m_s2_rad2": 0.02},
    "load_torque": {"torque_N_m": 0.3},
    "load_step": {"torque_N_m": 0.5, "time_s": 1.503},
    "gravity_torque": {"amplitude_N_m": 0.6, "phase_rad": 0.3},
    "cogging_torque": {"amplitude_N_m": 0.3, "periods_per_rev": 5.0, "phase_rad": 0.1},
    "end_stop": {"position_rad": 3.0, "stiffness_N_m_rad": 60.0},
    "end_stops": {"low_rad": -3.0, "high_rad": 3.0, "stiffness_N_m_rad": 60.0},
    "return_spring": {"stiffness_N_m_rad": 0.5},
    "hardening_spring": {"cubic_N_m_rad3": 0.02},
    "flexible_coupling": {"stiffness_N_m_rad": 30.0, "load_inertia_kg_m2": 0.02, "damping_N_m_s_rad": 0.05},
    "backlash": {"gap_rad": 0.2, "load_inertia_kg_m2": 0.03},
}

SHARES = {"torque_ripple": {"ratio": 0.2, "periods_per_rev": 3.0}, "load_dependent_friction": {"ratio": 0.15}}


def table(order: tuple[str, ...], *entries: dict[str, object], reverse: bool = False) -> dict[str, object]:
    lines = list(BALANCES.items())
    return {
        "kind": "ode",
        "states": list(order),
        "inputs": ["torque_N_m"],
        "outputs": {"speed_rad_s": "w2", "motor_speed_rad_s": "w1"},
        "derivatives": EQUATIONS,
        "balances": dict(reversed(lines) if reverse else lines),
        "effects": [*(reversed(entries) if reverse else entries)],
    }


def run(order: tuple[str, ...], *entries: dict[str, object], reverse: bool = False):
    return simulate(plant_from_table(table(order, *entries, reverse=reverse)), RUN, None)


@pytest.mark.parametrize("name", VALUES)
def test_an_effect_at_the_second_body_is_that_of_a_plant_whose_bodies_are_listed_the_other_way(name):
    entry = {"name": name, "at": "w2", **VALUES[name]}
    second, first = run(STATES, entry), run(("th2", "w2", "th1", "w1"), entry)
    assert second == pytest.approx(first, rel=1e-4, abs=1e-4 * np.max(np.abs(first)))
    assert np.max(np.abs(second - run(STATES))) > 0.02 * np.max(np.abs(second))  # it does something
    elsewhere = run(STATES, {**entry, "at": "w1"})
    assert np.max(np.abs(second - elsewhere)) > 0.01 * np.max(np.abs(second))


def test_drag_at_the_second_body_is_its_equation():
    def rate(t, x):
        torque = DRIVE[min(int(t / 0.005 + 1e-9), len(DRIVE) - 1)]
        th1, w1, th2, w2 = x
        twist = 8 * (th1 - th2) + 0.3 * (w1 - w2)
        return [w1, (torque - twist - 0.1 * w1) / 0.05, w2, (twist - 0.2 * w2 - 0.02 * abs(w2) * w2) / 0.08]

    state, seen = np.zeros(4), []
    for k in range(len(TIME)):
        seen.append(state[3])
        state = scipy.integrate.solve_ivp(
            lambda t, x, row=k: rate((row + 0.5) * 0.005, x), (0.0, 0.005), state, rtol=1e-9, atol=1e-12
        ).y[:, -1]
    found = run(STATES, {"name": "quadratic_drag", "at": "w2", **VALUES["quadratic_drag"]})
    assert found[:, 0] == pytest.approx(np.array(seen), abs=1e-5)


def test_the_order_of_lines_changes_nothing():
    entries = [
        {"name": "coulomb_friction", "at": "w1", "torque_N_m": 0.1},
        {"name": "coulomb_friction", "at": "w2", "torque_N_m": 0.2},
        {"name": "sensor_gain", "output": "speed_rad_s", "gain": 1.1},
        {"name": "sensor_offset", "output": "speed_rad_s", "offset_rad_s": 0.3},
        {"name": "gravity_torque", "at": "w2", **VALUES["gravity_torque"]},
    ]
    assert np.array_equal(run(STATES, *entries), run(STATES, *entries, reverse=True))


def test_places_and_values_survive_the_way_through_a_project():
    given = table(
        STATES,
        {"name": "coulomb_friction", "at": "w2", "torque_N_m": 0.2},
        {"name": "dead_zone", "half_width_N_m": 0.1},
    )
    plant = plant_from_table(given)
    assert {p.name for p in plant.parameters} == {"dead_zone.half_width_N_m", "coulomb_friction.w2.torque_N_m"}
    again = plant_from_table({**given, "effects": effects_table(plant)})
    assert again.effects == plant.effects and again.parameters == plant.parameters


def test_a_superset_keeps_an_effect_of_another_body():
    plant = plant_from_table(table(STATES, {"name": "coulomb_friction", "at": "w2", "torque_N_m": 0.2}))
    whole = superset(plant)
    assert whole.neutral["coulomb_friction.w2.torque_N_m"] == 0.2
    assert whole.simulate(RUN, {}, None) == pytest.approx(simulate(plant, RUN, None), abs=1e-6)


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"name": "coulomb_friction", "torque_N_m": 0.2}, r"coulomb_friction\.at is missing: it can act at w1, w2"),
        ({"name": "coulomb_friction", "at": "th2", "torque_N_m": 0.2}, r"at 'th2' is no state .* those are w1, w2"),
        ({"name": "coulomb_friction", "output": "speed_rad_s", "torque_N_m": 0.2}, r"output 'speed_rad_s' is not used"),
        ({"name": "sensor_gain", "at": "w2", "gain": 1.1}, r"sensor_gain\.at 'w2' is no state .* remove the key"),
        ({"name": "dead_zone", "at": "w2", "half_width_N_m": 0.1}, r"dead_zone\.at 'w2' is no state .* remove the key"),
        ({"name": "dead_zone", "output": "speed_rad_s", "half_width_N_m": 0.1}, r"is not used: .*; remove the key"),
        ({"name": "coulomb_friction", "at": "w2", "torque_N_m": 0.2, "on": "w1"}, "other keys are name, output and at"),
        ({"name": "coulomb_friction", "at": 2, "torque_N_m": 0.2}, r"at is 2; it must be the state of a balance"),
        ({"name": "brush_drop", "at": "w2", "voltage_V": 0.2}, "brush_drop needs a voltage .* kind = .voltage., per"),
        ({"name": "sensor_gain", "gain": 1.1}, r"output is missing: it can act on speed_rad_s, motor_speed_rad_s"),
        ({"name": "torque_ripple", "at": "w2", **SHARES["torque_ripple"]}, r"at 'w2' is no state .* those are w1$"),
    ],
)  # fmt: skip
def test_a_place_that_is_not_used_or_not_said_is_refused(entry, says):
    with pytest.raises(IdentifyError, match=says):
        plant_from_table(table(STATES, entry))


def test_one_body_needs_no_place_and_takes_its_name():
    motor = {
        "kind": "dc_motor", "input": "voltage_V", "outputs": ["speed_rad_s"],
        "parameters": {"R_ohm": 2.5, "L_H": 1e-3, "ke_V_s_rad": 0.04, "kt_N_m_A": 0.04, "J_kg_m2": 1e-5,
                       "b_N_m_s_rad": 0.0},
    }  # fmt: skip
    named = plant_from_table({**motor, "effects": [{"name": "load_torque", "at": "speed_rad_s", "torque_N_m": 0.01}]})
    plain = plant_from_table({**motor, "effects": [{"name": "load_torque", "torque_N_m": 0.01}]})
    assert named.parameters == plain.parameters
    assert places_of(plain, effects()["load_torque"]) == ("speed_rad_s",)
    assert with_effects(named, named.effects).effects == named.effects


@pytest.mark.parametrize("name", SHARES)
def test_a_share_of_the_drive_acts_on_the_driven_body_in_whatever_order_states_are_listed(name):
    entry = {"name": name, **SHARES[name]}
    first, last = run(STATES, entry), run(("th2", "w2", "th1", "w1"), {**entry, "at": "w1"})
    assert last == pytest.approx(first, rel=1e-4, abs=1e-4 * np.max(np.abs(first)))
    assert np.max(np.abs(first - run(STATES))) > 0.01 * np.max(np.abs(first))


def test_equations_that_differ_in_what_drives_a_body_alone_are_two_plants():
    """One was simulated as the other where both were loaded into one process."""
    entry = {"name": "torque_ripple", **SHARES["torque_ripple"]}
    halved = {**BALANCES, "w1": {**BALANCES["w1"], "effort": "0.5*torque_N_m"}}
    whole, half = (plant_from_table({**table(STATES, entry), "balances": made}) for made in (BALANCES, halved))
    less = {**entry, "ratio": 0.1}
    assert simulate(half, RUN, None) == pytest.approx(run(STATES, less), rel=1e-6, abs=1e-6)
    assert np.max(np.abs(simulate(whole, RUN, None) - simulate(half, RUN, None))) > 0.01


def test_a_share_of_a_drive_that_no_balance_names_is_refused_with_the_key():
    unnamed = {name: {k: v for k, v in made.items() if k != "effort"} for name, made in BALANCES.items()}
    given = {**table(STATES, {"name": "torque_ripple", **SHARES["torque_ripple"]}), "balances": unnamed}
    volts = {**given, "inputs": ["drive_V"], "derivatives": {**EQUATIONS, "w1": "(0.2*drive_V - 8*(th1 - th2)) / 0.05"}}
    with pytest.raises(IdentifyError, match=r"what the drive gives.* add effort = .*\[plant\.balances\.w1\]"):
        plant_from_table(volts)
    assert plant_from_table(given).driven == 0  # the input in N m pushes w1 alone


def test_an_effect_on_an_ode_without_balances_says_what_to_add():
    bare = {**table(STATES, {"name": "coulomb_friction", "torque_N_m": 0.2}), "balances": {}}
    with pytest.raises(IdentifyError, match=r'\[plant\.balances\], such as STATE = { kind = "torque", per ='):
        plant_from_table(bare)


def test_a_reading_is_found_by_the_unit_of_the_key_whatever_the_order_of_outputs():
    readings = {"speed_rad_s": "w2", "current_A": "torque_N_m/0.05"}
    entry = {"name": "sensor_offset", "offset_A": 0.3}
    for order in (readings, dict(reversed(readings.items()))):
        plant = plant_from_table({**table(STATES, entry), "outputs": order})
        assert [use.output for use in plant.effects] == ["current_A"]
        assert effects_table(plant)[0]["output"] == "current_A"
