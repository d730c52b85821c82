"""Plant kinds: found by folder, checked by name, and linear where they should be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import parameters_of
from firmloop.identify.plants.kinds import kinds, make_plant
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.units import unit_of

MOTOR = {
    "R_ohm": {"value": 8.0},
    "L_H": {"value": 1e-3, "free": False},
    "ke_V_s_rad": 0.02,
    "kt_N_m_A": {"value": 0.02, "free": True, "ci95": [0.019, 0.021]},
    "J_kg_m2": {"value": 3e-6},
    "b_N_m_s_rad": {"value": 3e-6},
}


def motor(*outputs: str, **changed: object):
    return make_plant("dc_motor", "voltage_V", outputs, {**MOTOR, **changed})


def test_every_kind_builds_and_names_its_parameters() -> None:
    assert set(kinds()) >= {"first_order", "second_order", "dc_motor"}
    for kind in kinds().values():
        outputs = kind.outputs or ("level_V",)
        values = {constant.name: 2.0 if constant.counted else 0.5 for constant in kind.constants}
        plant = make_plant(kind.name, (kind.inputs or (("anything",),))[0], outputs, values)
        assert [signal.name for signal in plant.inputs] == list((kind.inputs or (("anything",),))[0])
        assert [p.name for p in plant.parameters] == [constant.name for constant in kind.constants]
        assert [p.unit for p in plant.parameters] == [
            unit_of(constant.name) if constant.unit else "" for constant in kind.constants
        ]
        assert plant.rate.numel_out(0) == len(plant.states)
        assert plant.reading.numel_out(0) == len(plant.outputs)
        assert [p.free for p in plant.parameters] == [not constant.counted for constant in kind.constants]
        assert all(p.deviation is None for p in plant.parameters)


def test_parameters_carry_value_freedom_and_interval() -> None:
    by_name = {p.name: p for p in motor("speed_rad_s").parameters}
    assert (by_name["L_H"].value, by_name["L_H"].free) == (1e-3, False)
    assert by_name["ke_V_s_rad"].free
    assert by_name["kt_N_m_A"].deviation == pytest.approx(0.001 / 1.96, rel=1e-3)


def test_motor_has_only_the_states_its_outputs_need() -> None:
    def states(plant):
        return [signal.name for signal in plant.states]

    assert states(motor("speed_rad_s")) == ["current_A", "speed_rad_s"]
    assert states(motor("position_rad", "current_A")) == ["current_A", "speed_rad_s", "position_rad"]
    assert states(motor("speed_rad_s", "current_A", L_H={"value": 0.0, "free": False})) == ["speed_rad_s"]


def test_motor_linearizes_to_its_textbook_matrices() -> None:
    linear = linearize(motor("speed_rad_s", "current_A"))
    np.testing.assert_allclose(linear.a, [[-8e3, -20.0], [0.02 / 3e-6, -1.0]])
    np.testing.assert_allclose(linear.b, [[1e3], [0.0]])
    np.testing.assert_allclose(linear.c, [[0.0, 1.0], [1.0, 0.0]])
    assert np.all(linear.d == 0.0)
    assert linear.delay == 0.0


def test_motor_without_inductance_feeds_voltage_through_to_the_current() -> None:
    linear = linearize(motor("speed_rad_s", "current_A", L_H={"value": 0, "free": False}))
    np.testing.assert_allclose(linear.a, [[-(0.02 * 0.02 / 8.0 + 3e-6) / 3e-6]])
    np.testing.assert_allclose(linear.c, [[1.0], [-0.02 / 8.0]])
    np.testing.assert_allclose(linear.d, [[0.0], [1.0 / 8.0]])


def test_lags_linearize_with_their_delay() -> None:
    first = linearize(make_plant("first_order", "u", ["y"], {"gain": 4.0, "time_constant_s": 0.5, "delay_s": 0.1}))
    assert (first.a, first.b, first.delay) == (-2.0, 8.0, 0.1)
    values = {"gain": 4.0, "natural_frequency_rad_s": 10.0, "damping_ratio": 0.3, "delay_s": 0.0}
    second = linearize(make_plant("second_order", "u", ["y"], values))
    np.testing.assert_allclose(second.a, [[0.0, 1.0], [-100.0, -6.0]])
    np.testing.assert_allclose(second.b, [[0.0], [400.0]])


@pytest.mark.parametrize(
    ("kind", "output", "effect", "units"),
    [
        ("first_order", "speed_rad_s", "coulomb_friction", ["rad/s"]),
        ("first_order", "speed_rad_s", "quadratic_drag", ["s/rad"]),
        ("first_order", "speed_m_s", "flexible_coupling", ["1/s", "s", "1"]),
        ("first_order", "level_cm", "load_torque", ["cm"]),
        ("first_order", "level_cm", "presliding_friction", ["1/s", "cm"]),
        ("first_order", "level_cm", "backlash", ["cm*s", "s", "1/s", "1"]),
        ("first_order", "flow_l_min", "quadratic_drag", ["min/l"]),
        ("first_order", "y", "load_torque", [""]),
        ("first_order", "y", "flexible_coupling", ["1/s", "s", "1"]),
        ("second_order", "level_mm", "hardening_spring", ["1/mm^2"]),
        ("second_order", "level_mm", "stribeck_friction", ["mm", "mm", "mm/s"]),
        ("second_order", "position_m", "hardening_spring", ["1/m^2"]),
        ("second_order", "position_rad", "load_torque", ["rad"]),
        ("linear_stage", "speed_m_s", "quadratic_drag", ["N*s^2/m^2"]),
        ("rotary_stage", "speed_rad_s", "hardening_spring", ["N*m/rad^3"]),
    ],
)
def test_what_an_effect_takes_of_a_lag_is_in_the_unit_of_its_output(
    kind: str, output: str, effect: str, units: list[str]
) -> None:
    drive, values = {
        "linear_stage": ("force_N", {"mass_kg": 1.0, "b_N_s_m": 1.0}),
        "rotary_stage": ("torque_N_m", {"J_kg_m2": 1.0, "b_N_m_s_rad": 1.0}),
    }.get(kind, ("u", {}))
    plant = make_plant(kind, drive, [output], values)
    assert [each.unit for each in parameters_of(plant, effect)] == units


@pytest.mark.parametrize(
    ("drive", "output", "effect", "unit"),
    [
        ("pump_V", "level_cm", "sensor_offset", "cm"),
        ("pump_V", "level_cm", "dead_zone", "V"),
        ("inflow_cm3_s", "level_cm", "dead_zone", "cm3/s"),
        ("inflow_cm3_s", "level_cm", "slew_rate_limit", "cm3/s^2"),
        ("pump_V", "level_cm", "slew_rate_limit", "V/s"),
        ("u", "y", "slew_rate_limit", "/s"),
        ("u", "y", "sensor_offset", ""),
    ],
)
def test_what_an_effect_does_to_a_signal_is_in_the_unit_that_its_column_names(
    drive: str, output: str, effect: str, unit: str
) -> None:
    (known,) = parameters_of(make_plant("first_order", drive, [output], {}), effect)
    assert known.unit == unit


def test_left_out_parameters_wait_to_be_fitted() -> None:
    plant = make_plant("first_order", "u", ["y"], {})
    assert all(math.isnan(p.value) and p.free for p in plant.parameters)
    with pytest.raises(IdentifyError, match=r"plant\.parameters\.gain has no value"):
        linearize(plant)


WRONG = {
    "unknown kind": (("motor", "voltage_V", ["speed_rad_s"], {}), "plant.kind 'motor' is unknown; known: dc_motor"),
    "wrong input": (("dc_motor", "duty", ["speed_rad_s"], MOTOR), "plant.input 'duty'"),
    "wrong output": (("dc_motor", "voltage_V", ["speed_rpm"], MOTOR), "'speed_rpm' is unknown to dc_motor"),
    "no output": (("dc_motor", "voltage_V", [], MOTOR), "plant.outputs"),
    "output twice": (("dc_motor", "voltage_V", ["current_A", "current_A"], MOTOR), "stands twice"),
    "two outputs of a lag": (("first_order", "u", ["y", "z"], {}), "exactly one"),
    "unknown parameter": (("first_order", "u", ["y"], {"tau": 1.0}), "plant.parameters.tau"),
    "missing parameter": (("dc_motor", "voltage_V", ["current_A"], {"R_ohm": 1.0}), "L_H is missing"),
    "unknown key": (("first_order", "u", ["y"], {"gain": {"value": 1.0, "fixed": True}}), "gain.fixed is unknown"),
    "no value": (("first_order", "u", ["y"], {"gain": {"free": True}}), "gain.value is missing"),
    "text": (("first_order", "u", ["y"], {"gain": {"value": "one"}}), "must be a number"),
    "NaN": (("first_order", "u", ["y"], {"gain": math.nan}), "must be a number"),
    "free is a word": (("first_order", "u", ["y"], {"gain": {"value": 1.0, "free": "yes"}}), "true"),
    "negative lag": (("first_order", "u", ["y"], {"time_constant_s": -1.0}), "must lie within 0"),
    "no lag": (("first_order", "u", ["y"], {"time_constant_s": 0.0}), "must be above 0"),
    "negative delay": (("first_order", "u", ["y"], {"delay_s": -0.1}), "must lie within 0"),
    "outside own bounds": (("first_order", "u", ["y"], {"gain": {"value": 3.0, "high": 2.0}}), "within -inf and 2"),
    "interval": (("first_order", "u", ["y"], {"gain": {"value": 3.0, "ci95": [4, 2]}}), "ci95"),
    "free zero inductance": (
        ("dc_motor", "voltage_V", ["current_A"], {**MOTOR, "L_H": 0.0}),
        "L_H.value is 0 and free",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_plant_is_refused_by_name(case: str) -> None:
    arguments, words = WRONG[case]
    with pytest.raises(IdentifyError) as refused:
        make_plant(*arguments)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("voltage_V", "V"),
        ("speed_rad_s", "rad/s"),
        ("torque_N_m", "N*m"),
        ("speed_m_s", "m/s"),
        ("temperature_C", "degC"),
        ("reference_rad_s", "rad/s"),
        ("b_N_m_s_rad", "N*m*s/rad"),
        ("motor_cmd_norm", ""),
        ("speed_rpm", "rpm"),
    ],
)
def test_units_are_read_from_names(name: str, unit: str) -> None:
    assert unit_of(name) == unit
