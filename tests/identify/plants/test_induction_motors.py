"""Induction motors: the dq equations against the revolving-field circuit, and the standard tests against both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.diagnose.induction_faults import CASES, diagnosed
from bench.diagnose.induction_truth import Motor
from firmloop.identify.bench_tests.induction_tests import (
    AcTest,
    at_temperature,
    leakage_reactance,
    locked_rotor,
    magnetizing_reactance,
    rotational_loss,
    rotor_resistance,
    turns_ratio,
    winding_resistance,
)
from firmloop.identify.bench_tests.revolving_field import at_load, breakdown, running
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.effects import candidates
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import constants_of, course_of, simulate, simulator

MOTOR = {
    "main_R_ohm": 0.525,
    "main_L_H": 1.0e-3,
    "aux_R_ohm": 1.17,
    "aux_L_H": 1.3e-3,
    "rotor_R_ohm": 0.6,
    "rotor_L_H": 1.0e-3,
    "magnetizing_L_H": 0.058,
    "turns_ratio": 1.3,
    "pole_pairs": 2.0,
    "capacitance_F": 340e-6,
    "switch_open_rad_s": 140.0,
    "switch_close_rad_s": 80.0,
    "J_kg_m2": 0.03,
    "b_N_m_s_rad": 1e-4,
    "load_N_m_s2_rad2": 1e-4,
    "rise_K_per_W": 0.0,
    "heating_time_s": 100.0,
    "frequency_Hz": 60.0,
}
THREE_PHASE = {
    "stator_R_ohm": 0.5,
    "stator_L_H": 2e-3,
    "rotor_R_ohm": 0.4,
    "rotor_L_H": 2e-3,
    "magnetizing_L_H": 0.06,
    "pole_pairs": 2.0,
    "J_kg_m2": 0.02,
    "b_N_m_s_rad": 0.04,
    "load_N_m_s2_rad2": 0.0,
    "frequency_Hz": 60.0,
}
SYNCHRONOUS = math.pi * 60.0
OUTPUTS = ("speed_rad_s", "main_current_A", "aux_current_A", "line_current_A", "torque_N_m")


def mains(seconds: float, volts: float = 115.0) -> Recording:
    time = np.arange(round(seconds * 1000)) * 1e-3
    return make_recording(time, {"voltage_rms_V": np.full(len(time), volts)}, "simulated", "")


def motor(**changed: float) -> Plant:
    return make_plant("single_phase_induction_motor", "voltage_rms_V", OUTPUTS, {**MOTOR, **changed})


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_running_motor_stands_where_the_revolving_fields_say() -> None:
    shown = simulate(motor(J_kg_m2=0.05), mains(2.5), None)[-500:]
    slip = 1.0 - float(shown[:, 0].mean()) / SYNCHRONOUS
    expected = running(MOTOR, 115.0, slip, False)
    assert 0.005 < slip < 0.05
    assert rms(shown[:, 1]) == pytest.approx(abs(expected.main), rel=2e-3)
    assert float(shown[:, 4].mean()) == pytest.approx(expected.torque, rel=5e-3)
    assert np.all(np.abs(shown[:, 2]) < 1e-9), "the centrifugal switch is open"


@pytest.mark.parametrize("slip", [1.0, 0.6, 0.35])
def test_the_starting_motor_stands_where_the_revolving_fields_say(slip: float) -> None:
    """A shaft so heavy that it keeps the speed it is given."""
    start = np.zeros(9)
    start[5] = (1.0 - slip) * SYNCHRONOUS
    shown = simulate(motor(J_kg_m2=1e6), mains(1.0), start)[-500:]
    expected = running(MOTOR, 115.0, slip, True)
    assert rms(shown[:, 1]) == pytest.approx(abs(expected.main), rel=3e-3)
    assert rms(shown[:, 2]) == pytest.approx(abs(expected.aux), rel=3e-3)
    assert rms(shown[:, 3]) == pytest.approx(expected.line, rel=3e-3)
    assert float(shown[:, 4].mean()) == pytest.approx(expected.torque, rel=1e-2)


def test_a_measured_voltage_drives_the_motor_as_its_rms_value_does() -> None:
    fine = np.arange(20_000) * 2e-5
    sine = make_recording(fine, {"voltage_V": math.sqrt(2) * 115.0 * np.sin(120 * math.pi * fine)}, "", "")
    held = {**MOTOR, "frequency_Hz": {"value": 60.0, "free": False}}
    direct = simulate(make_plant("single_phase_induction_motor", "voltage_V", ["speed_rad_s"], held), sine, None)
    even = make_recording(fine, {"voltage_rms_V": np.full(len(fine), 115.0)}, "", "")
    np.testing.assert_allclose(direct[:, 0], simulate(motor(), even, None)[:, 0], atol=0.3)


def test_the_winding_warms_by_its_copper_loss() -> None:
    plant = make_plant(
        "single_phase_induction_motor",
        "voltage_rms_V",
        ["rise_K", "main_current_A"],
        {**MOTOR, "rise_K_per_W": 0.2, "heating_time_s": 1.0},
    )
    rise, current = simulate(plant, mains(9.0), None)[-250:].T
    warm = 1 + 0.00393 * float(rise.mean())
    assert float(rise.mean()) == pytest.approx(0.2 * MOTOR["main_R_ohm"] * warm * rms(current) ** 2, rel=0.01)
    assert float(rise.mean()) > 10.0


def test_effects_attach_to_the_shaft() -> None:
    table = {
        "kind": "single_phase_induction_motor",
        "input": "voltage_rms_V",
        "outputs": ["speed_rad_s"],
        "parameters": MOTOR,
        "effects": [{"name": "load_step", "torque_N_m": 2.0, "time_s": 1.0}],
    }
    speed = simulate(plant_from_table(table), mains(2.0), None)[:, 0]
    slip = 1.0 - float(speed[-250:].mean()) / SYNCHRONOUS
    friction = 1e-4 * speed[-1] + 1e-4 * speed[-1] ** 2
    assert running(MOTOR, 115.0, slip, False).torque == pytest.approx(2.0 + friction, rel=0.01)
    assert speed[900:1000].mean() > speed[-250:].mean() + 0.5


def test_a_three_phase_motor_gives_the_torque_of_its_circuit() -> None:
    plant = make_plant("three_phase_induction_motor", "voltage_rms_V", ["speed_rad_s", "torque_N_m"], THREE_PHASE)
    speed, torque = simulate(plant, mains(2.0, 200.0), None)[-100:].T
    slip, w = 1 - float(speed.mean()) / SYNCHRONOUS, 120 * math.pi
    rotor, across = 0.4 / slip + 1j * w * 2e-3, 1j * w * 0.06
    current = 200.0 / math.sqrt(3) / (0.5 + 1j * w * 2e-3 + rotor * across / (rotor + across))
    through = abs(current * across / (across + rotor)) ** 2 * 0.4 / slip
    assert float(torque.mean()) == pytest.approx(3 * through / SYNCHRONOUS, rel=1e-3)


def test_the_standard_tests_find_the_circuit_that_was_tested() -> None:
    w = 120 * math.pi
    still, idle = running(MOTOR, 40.0, 1.0, False), running(MOTOR, 115.0, 1e-9, False)
    locked = locked_rotor(AcTest(40.0, abs(still.main), still.power_in))
    leakage = leakage_reactance(locked)
    assert rotor_resistance(locked, 0.525) == pytest.approx(0.6, rel=0.05)  # the magnetizing branch takes its share
    assert leakage == pytest.approx(w * 1.0e-3, rel=0.05)
    no_load = AcTest(115.0, abs(idle.main), idle.power_in)
    assert magnetizing_reactance(no_load, leakage) == pytest.approx(w * 0.058, rel=0.03)
    assert rotational_loss(no_load, 0.525, 0.6) == pytest.approx(0.0, abs=3.0)
    assert winding_resistance(2.1, 4.0) == 0.525
    assert at_temperature(1.0, 25.0, 87.0) == pytest.approx((234.5 + 87.0) / (234.5 + 25.0))
    assert turns_ratio(1.3 * 0.9 * 115.0, 0.9 * 149.5 / 1.3, 115.0, 149.5) == pytest.approx(1.3)


@pytest.mark.parametrize(("leakage", "across"), [(0.4, 22.0), (3.0, 22.0), (8.0, 11.0)])
def test_the_magnetizing_reactance_is_what_the_circuit_leaves(leakage: float, across: float) -> None:
    """Main winding X1, in series half of Xm, forward and open, and half of X2, backward and short."""
    shown = complex(0.5, leakage + across / 2 + leakage / 2)
    current = 115.0 / abs(shown)
    found = magnetizing_reactance(AcTest(115.0, current, current**2 * 0.5), leakage)
    assert found == pytest.approx(across, rel=1e-9)
    just = AcTest(1.499 * leakage, 1.0, 1e-6)  # less than the leakage alone would show
    with pytest.raises(IdentifyError, match="contradict each other"):
        magnetizing_reactance(just, leakage)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: locked_rotor(AcTest(40.0, 10.0, 401.0)), "power factor would be above 1"),
        (lambda: locked_rotor(AcTest(40.0, 0.0, 1.0)), "the current of the locked-rotor test is 0 A"),
        (lambda: rotor_resistance(locked_rotor(AcTest(10.0, 10.0, 50.0)), 0.6), "leaves nothing for the rotor"),
        (lambda: magnetizing_reactance(AcTest(10.0, 10.0, 10.0), 0.8), "contradict each other"),
        (lambda: winding_resistance(math.nan, 1.0), "the direct voltage is nan V"),
        (
            lambda: make_plant("single_phase_induction_motor", "voltage_V", ["speed_rad_s"], MOTOR),
            "frequency_Hz is free",
        ),
    ],
)
def test_impossible_readings_are_refused(asked, words: str) -> None:
    with pytest.raises(IdentifyError, match=words):
        asked()


def test_load_points_hold_to_their_power() -> None:
    point = at_load(MOTOR, 115.0, 746.0, 30.0)
    assert point.torque * point.speed == pytest.approx(776.0, rel=1e-6)
    assert point.torque < breakdown(MOTOR, 115.0).torque
    with pytest.raises(ValueError, match="is more than this motor gives"):
        at_load(MOTOR, 115.0, 9e3, 30.0)


def test_an_aged_capacitor_is_an_effect_of_its_own() -> None:
    table = {
        "kind": "single_phase_induction_motor",
        "input": "voltage_rms_V",
        "outputs": ["speed_rad_s", "aux_current_A"],
        "parameters": MOTOR,
        "effects": [{"name": "capacitor_ageing", "loss": 0.1}],
    }
    aged = simulate(plant_from_table(table), mains(0.2), None)
    smaller = simulate(motor(capacitance_F=0.9 * 340e-6), mains(0.2), None)
    np.testing.assert_allclose(aged[:, 0], smaller[:, 0], atol=0.01)
    np.testing.assert_allclose(aged[:, 1], smaller[:, 2], atol=0.05)


def test_saturated_iron_takes_more_current_for_the_same_flux() -> None:
    """At no load the voltage fixes the flux of the air gap, and the cubic of iron.py says what it takes."""
    free = {"b_N_m_s_rad": 0.0, "load_N_m_s2_rad2": 0.0, "J_kg_m2": 0.002}
    shown = []
    for effects in ([], [{"name": "magnetizing_saturation", "current_A": 8.0}]):
        values = {**THREE_PHASE, **free}
        table = {"kind": "three_phase_induction_motor", "input": "voltage_rms_V", "outputs": ["phase_current_A"]}
        plant = plant_from_table({**table, "parameters": values, "effects": effects})
        shown.append(math.sqrt(2.0) * rms(simulate(plant, mains(2.0, 100.0), None)[-500:, 0]))
    linear, bent = shown
    w, peak, flux = 120 * math.pi, math.sqrt(2.0 / 3.0) * 100.0, 0.0
    for _ in range(50):
        current = flux / 0.06 * (1.0 + (flux / (0.06 * 8.0)) ** 2)
        # What the stator's resistance and leakage leave of the voltage.
        flux = 0.5 * flux + 0.5 * (math.sqrt(peak**2 - (0.5 * current) ** 2) / w - 2e-3 * current)
    assert bent == pytest.approx(current, rel=0.01)
    assert bent > 1.1 * linear


def test_the_switch_can_be_identified() -> None:
    """Its slopes are those of the simulation, though it moves once and within milliseconds."""
    plant = motor()
    names = [parameter.name for parameter in plant.parameters]
    course, constants = course_of(plant, mains(0.6)), constants_of(plant)
    engine, start = simulator(plant), np.zeros(9)
    for name in ("switch_open_rad_s", "J_kg_m2"):
        index = names.index(name)
        _, slopes = engine.run_with_slopes(course, constants, start, (index,))
        step = 1e-6 * constants[index]
        ends = [
            engine.run(course, constants + sign * step * (np.arange(len(names)) == index), start) for sign in (1, -1)
        ]
        quotient = (ends[0] - ends[1]) / (2.0 * step)
        assert rms(quotient[:, 2]) > 0.0
        assert rms(slopes[:, 2, 0] - quotient[:, 2]) < 1e-3 * rms(quotient[:, 2])


def test_rotor_and_inertia_are_identified_from_a_start_far_away() -> None:
    """The switch begins closed whatever the search tries: where it began has died out before it opens."""
    recording, wires = mains(0.4), OUTPUTS[:3]
    truth = simulate(motor(), recording, None)[:, :3]
    noisy = truth + np.random.default_rng(4).normal(size=truth.shape) * (0.5, 0.3, 0.3)
    columns = {**recording.columns, **dict(zip(wires, noisy.T, strict=True))}
    free = {"rotor_R_ohm": 1.8, "J_kg_m2": 0.015}
    asked = {key: {"value": free.get(key, value), "free": key in free} for key, value in MOTOR.items()}
    plant = make_plant("single_phase_induction_motor", "voltage_rms_V", wires, asked)
    found = fit(plant, [make_recording(recording.time, columns, "", "")], [], NONE)
    assert found.noise["main_current_A"] == pytest.approx(0.3, rel=0.15)
    for parameter in found.plant.parameters:
        if parameter.free:
            assert parameter.deviation is not None
            assert abs(parameter.value - MOTOR[parameter.name]) < 3.0 * parameter.deviation < 0.01 * parameter.value


def test_the_simulator_agrees_with_one_written_apart() -> None:
    time = np.arange(400) * 1e-3
    volts = np.where(time < 0.35, 115.0, 0.0)
    concealed = {"knee": 8.0, "lost": 0.1, "heat": (0.05, 0.5), "load": (3.0, 0.3003)}
    truth = Motor(MOTOR, **concealed).run(time, volts)
    effects = [
        {"name": "magnetizing_saturation", "current_A": 8.0},
        {"name": "capacitor_ageing", "loss": 0.1},
        {"name": "resistance_heating", "rise_K_per_W": 0.05, "time_constant_s": 0.5},
        {"name": "load_step", "torque_N_m": 3.0, "time_s": 0.3003},
    ]
    table = {"kind": "single_phase_induction_motor", "input": "voltage_rms_V", "outputs": list(OUTPUTS[:3])}
    plant = plant_from_table({**table, "parameters": MOTOR, "effects": effects})
    found = simulate(plant, make_recording(time, {"voltage_rms_V": volts}, "simulated", ""), None)
    np.testing.assert_allclose(found, truth, atol=2e-3)


def test_what_limits_the_studies_can_be_looked_for() -> None:
    names = {effect.name for effect in candidates(motor())}
    limits = {"magnetizing_saturation", "resistance_heating", "coulomb_friction", "load_step", "capacitor_ageing"}
    assert limits <= names
    assert not names & {"inductance_saturation", "torque_constant_saturation", "brush_drop", "supply_sag"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["resistance_heating"])
def test_what_is_concealed_is_found_through_the_command_line(name: str) -> None:
    case = CASES[name]
    status, found = diagnosed(case)
    assert (status, found["verdict"]) == (1, "explained")
    assert [effect["name"] for effect in found["effects"]] == [name]
    value = found["effects"][0]["parameters"][case.parameter]["value"]
    assert value == pytest.approx(case.value, rel=0.1)
