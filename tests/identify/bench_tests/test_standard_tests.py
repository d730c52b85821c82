"""Datasheets and standard tests give the parameters they are made from; what cannot be is said."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmloop.identify.bench_tests.datasheets import read_sheet, sheets
from firmloop.identify.bench_tests.motor_forms import motor_forms
from firmloop.identify.bench_tests.quantity import in_si
from firmloop.identify.bench_tests.standard_tests import (
    coast_down,
    locked_rotor_ac,
    locked_rotor_dc,
    no_load,
    step_test,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import simulate

R, L, K, J, B, TC = 24.5, 5e-4, 0.0136, 6.8e-8, 5e-8, 4e-5
PARAMETERS = {"R_ohm": R, "L_H": L, "ke_V_s_rad": K, "kt_N_m_A": K, "J_kg_m2": J, "b_N_m_s_rad": B}
SHEET = sheets()["dc_motor"]


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("13.6 mN*m/A", "N*m/A", 0.0136),
        ("13.6 mN m/A", "V*s/rad", 0.0136),
        ("8350 rpm", "rad/s", 8350 * 2 * math.pi / 60),
        ("702 rpm/V", "rad/s/V", 702 * 2 * math.pi / 60),
        ("0.68 g*cm^2", "kg*m^2", 0.68e-7),
        ("0.203 lb*ft^2", "kg*m^2", 0.203 * 0.45359237 * 0.3048**2),
        ("3.01 lb-ft", "N*m", 3.01 * 0.45359237 * 9.80665 * 0.3048),
        ("10 oz*in", "N*m", 10 * 0.45359237 / 16 * 9.80665 * 0.0254),
        ("1 hp", "W", 745.6998715822702),
        ("1260 rpm/(mN*m)", "rad/s/N/m", 1260 * 2 * math.pi / 60 / 1e-3),
        ("340 uF", "F", 340e-6),
        ("77.8 %", "1", 0.778),
        ("9 ms", "s", 0.009),
        (0.5, "H", 0.5),
    ],
)
def test_units(text, dimension, si):
    assert in_si(text, dimension, "key") == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("8350", "no unit"),
        ("8350 m", "no rad/s"),
        ("8 furlong", "furlong"),
        ("fast", "number and its unit"),
        (True, "a"),
    ],
)
def test_wrong_units_are_said(text, words):
    with pytest.raises(IdentifyError, match=words):
        in_si(text, "rad/s", "datasheet.no_load_speed")


CONSISTENT = {
    "nominal_voltage": 12.0,
    "terminal_resistance": R,
    "terminal_inductance": L,
    "torque_constant": K,
    "rotor_inertia": J,
    "stall_current": 12.0 / R,
    "stall_torque": K * 12.0 / R,
    "no_load_current": 0.007,
    "no_load_speed": (12.0 - R * 0.007) / K,
    "mechanical_time_constant": J * R / K**2,
}


def test_a_consistent_sheet_contradicts_nothing_and_gives_the_rest():
    reading = read_sheet(SHEET, CONSISTENT, 0.001)
    assert reading.contradictions == ()
    assert reading.figures["speed_constant"] == pytest.approx(1 / K)
    assert reading.figures["damping"] == pytest.approx(K * 0.007 / CONSISTENT["no_load_speed"])


@pytest.mark.parametrize("figure", ["torque_constant", "rotor_inertia", "stall_current", "no_load_speed"])
def test_a_wrong_figure_is_named_with_the_amount(figure):
    reading = read_sheet(SHEET, {**CONSISTENT, figure: 1.3 * CONSISTENT[figure]}, 0.05)
    assert reading.contradictions
    for entry in reading.contradictions:
        assert figure == entry.figure or figure in entry.others
        assert abs(entry.share) > 0.05


def test_the_two_figures_are_told():
    table = {"torque_constant": "13.6 mN*m/A", "speed_constant": "900 rpm/V"}
    (entry,) = read_sheet(SHEET, table, 0.05).contradictions
    said = entry.sentence(SHEET)
    assert "torque_constant is 0.0136" in said and "speed_constant leads to 0.01061" in said and "+28.2%" in said


def test_locked_rotor():
    current = np.array([0.05, 0.1, 0.15])
    found = locked_rotor_dc((R * current + 0.4).tolist(), current.tolist())  # brushes drop 0.4 V
    assert found["R_ohm"].value == pytest.approx(R)
    frequency = np.array([5e3, 1e4])
    volts = 0.05 * np.hypot(R, 2 * math.pi * frequency * L)
    assert locked_rotor_ac(volts.tolist(), [0.05, 0.05], frequency.tolist(), R)["L_H"].value == pytest.approx(L)
    with pytest.raises(IdentifyError, match="not above the resistance"):
        locked_rotor_ac([1.0], [0.05], [50.0], R)


def test_no_load_tells_viscous_from_coulomb_friction():
    speed = np.array([200.0, 500.0, 800.0])
    current = (TC + B * speed) / K
    found = no_load((R * current + K * speed).tolist(), current.tolist(), speed.tolist(), R)
    assert found["ke_V_s_rad"].value == pytest.approx(K)
    assert found["b_N_m_s_rad"].value == pytest.approx(B, rel=1e-6)
    assert found["coulomb_N_m"].value == pytest.approx(TC, rel=1e-6)
    with pytest.raises(IdentifyError, match="more than the 1 V applied"):
        no_load([1.0], [0.5], [100.0], R)


def test_repeats_of_one_point_are_averaged_by_students_t():
    """Three readings each, as close as a bench makes them: no slope can be told, and 4.303 deviations are 95 %."""
    volts, amperes = [1.0, 1.01, 0.99], [1.0 / R, 1.002 / R, 0.997 / R]
    found = locked_rotor_dc(volts, amperes)["R_ohm"]
    each = np.array(volts) / np.array(amperes)
    assert found.value == pytest.approx(np.mean(each))
    assert 1.96 * found.deviation == pytest.approx(4.3027 * np.std(each, ddof=1) / math.sqrt(3), rel=1e-3)
    running = no_load([12.0] * 3, [0.007, 0.0071, 0.0069], [870.0, 871.0, 869.0], R)
    assert "coulomb_N_m" not in running
    assert running["b_N_m_s_rad"].value == pytest.approx(running["ke_V_s_rad"].value * 0.007 / 870.0, rel=1e-3)
    assert 0.01 < 1.96 * running["b_N_m_s_rad"].deviation / running["b_N_m_s_rad"].value < 0.1


def test_what_is_unsure_of_the_resistance_is_unsure_of_all_that_rests_on_it():
    volts = 0.05 * np.hypot(R, 2 * math.pi * 1e4 * L)
    doubt = 0.5
    found = locked_rotor_ac([volts] * 3, [0.05] * 3, [1e4] * 3, R, doubt)["L_H"]
    moved = locked_rotor_ac([volts], [0.05], [1e4], R + 1e-3)["L_H"].value
    assert found.deviation == pytest.approx(abs(moved - found.value) / 1e-3 * doubt, rel=1e-2)
    constant = no_load([12.0], [0.007], [870.0], R, doubt)["ke_V_s_rad"]
    assert constant.deviation == pytest.approx(doubt * 0.007 / 870.0)


def test_a_friction_below_zero_is_none():
    """Current that rises faster than speed: there is no Coulomb part, and all of it is viscous."""
    found = no_load([4.0, 8.0, 12.0], [0.002, 0.005, 0.009], [290.0, 580.0, 860.0], R)
    assert found["coulomb_N_m"].value == 0.0
    ratio = found["kt_N_m_A"].value * np.array([0.002, 0.005, 0.009]) / np.array([290.0, 580.0, 860.0])
    assert found["b_N_m_s_rad"].value == pytest.approx(float(np.mean(ratio)))


@pytest.mark.parametrize("coulomb", [0.0, TC])
@pytest.mark.parametrize("damping", [0.0, B])
def test_coast_down(damping, coulomb):
    if damping == coulomb == 0.0:
        with pytest.raises(IdentifyError, match="without friction"):
            coast_down(np.arange(10.0), np.linspace(10, 1, 10), 0.0, 0.0)
        return
    time = np.arange(0, 4.0, 2e-3)
    if damping:
        speed = (800 + coulomb / damping) * np.exp(-time * damping / J) - coulomb / damping
    else:
        speed = 800 - coulomb / J * time
    speed = np.maximum(speed, 0) + np.random.default_rng(1).normal(0, 1.0, len(time))
    found = coast_down(time, speed, damping, coulomb)["J_kg_m2"]
    assert abs(found.value - J) < 4 * found.deviation < 0.02 * J


def test_step_test_and_forms_are_the_motor():
    """The first-order form is the plant without L; the time constant of its step gives J back."""
    slow = motor_forms(PARAMETERS)["first order"]
    assert step_test(slow.denominator[0] / slow.denominator[1], PARAMETERS)["J_kg_m2"].value == pytest.approx(J)
    full = motor_forms(PARAMETERS)["second order"]
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], PARAMETERS)
    linear = linearize(plant)
    assert np.allclose(linear.a, full.a) and np.allclose(linear.b, full.b) and np.allclose(linear.c, full.c)
    assert np.roots(full.denominator) == pytest.approx(np.linalg.eigvals(full.a))
    time = np.linspace(0, 0.1, 400)
    step = make_recording(time, {"voltage_V": np.full(400, 12.0)}, "step", "")
    assert simulate(plant, step, None)[-1, 0] == pytest.approx(12 * full.numerator[0] / full.denominator[-1], rel=1e-3)
