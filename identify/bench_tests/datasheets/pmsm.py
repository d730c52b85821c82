"""What the sheet of a permanent-magnet machine prints, a servo maker's or a hobby shop's, and its standard tests.

All of it becomes the values of the star that acts like the machine: what is measured between two terminals is twice
one phase of that star however it is wound, and a winding in delta counts a third. Kv is the speed over the amplitude
of the voltage between two terminals, as makers give it, or over that of one phase.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from firmloop.identify.bench_tests.datasheets import RECORDING, Relation, Sheet, StandardTest
from firmloop.identify.bench_tests.standard_tests import Measured
from firmloop.identify.bench_tests.synchronous_tests import alignment, locked_axis, phase_to_phase, run_up, spinning
from firmloop.identify.recordings.recording import Recording, column

IEEE = "IEEE Std 1812-2014, Guide for Testing Permanent Magnet Machines"
KRISHNAN = "R. Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives (2010), section 3.3"
ROOT_3 = math.sqrt(3.0)
Known = Mapping[str, Measured]
Readings = Mapping[str, Sequence[float]]


def _between(given: Readings, known: Known) -> Known:
    return phase_to_phase(given["voltage_V"], given["current_A"])


def _locked_d(given: Recording, known: Known) -> Known:
    return locked_axis(given.time, column(given, "voltage_d_V"), column(given, "current_d_A"), "d")


def _locked_q(given: Recording, known: Known) -> Known:
    found = locked_axis(given.time, column(given, "voltage_q_V"), column(given, "current_q_A"), "q")
    return {name: one for name, one in found.items() if name == "Lq_H" or name not in known}


def _spin(given: Readings, known: Known) -> Known:
    return spinning(given["voltage_V"], given["speed_rad_s"], known["pole_pairs"].value)


def _aligned(given: Readings, known: Known) -> Known:
    return alignment(given["position_rad"], known["pole_pairs"].value)


def _run_up(given: Recording, known: Known) -> Known:
    constant = 1.5 * known["pole_pairs"].value * known["flux_Wb"].value
    found = run_up(given.time, column(given, "current_q_A"), column(given, "speed_rad_s"), constant)
    share = (known["flux_Wb"].deviation or 0.0) / known["flux_Wb"].value
    return {
        name: one if one.deviation is None else Measured(one.value, math.hypot(one.deviation, share * one.value))
        for name, one in found.items()
    }


SHEET = Sheet(
    kind="pmsm",
    counted={"poles": 2, "pole_pairs": 1},
    figures={
        "poles": "1",
        "pole_pairs": "1",
        "nominal_voltage": "V",
        "kv": "rad/s/V",
        "kv_of_a_phase": "rad/s/V",
        "flux": "V*s",
        "torque_constant": "N*m/A",
        "torque_constant_of_amplitude": "N*m/A",
        "torque_constant_of_rms": "N*m/A",
        "phase_to_phase_resistance": "ohm",
        "phase_resistance": "ohm",
        "delta_winding_resistance": "ohm",
        "phase_to_phase_inductance": "H",
        "phase_inductance": "H",
        "delta_winding_inductance": "H",
        "d_axis_inductance": "H",
        "q_axis_inductance": "H",
        "no_load_current": "A",
        "no_load_speed": "rad/s",
        "rotor_inertia": "kg*m^2",
        "damping": "N*m*s/rad",
    },
    relations=(
        Relation("pole_pairs", ("poles",), lambda n: n / 2.0, "p = poles/2", KRISHNAN),
        Relation("phase_resistance", ("phase_to_phase_resistance",), lambda r: r / 2.0, "R = R_ab/2", IEEE),
        Relation("phase_resistance", ("delta_winding_resistance",), lambda r: r / 3.0, "R = R_delta/3", IEEE),
        Relation("phase_inductance", ("phase_to_phase_inductance",), lambda x: x / 2.0, "L = L_ab/2", IEEE),
        Relation("phase_inductance", ("delta_winding_inductance",), lambda x: x / 3.0, "L = L_delta/3", IEEE),
        Relation("d_axis_inductance", ("phase_inductance",), lambda x: x, "Ld = L without saliency", KRISHNAN),
        Relation("q_axis_inductance", ("phase_inductance",), lambda x: x, "Lq = L without saliency", KRISHNAN),
        Relation("kv", ("kv_of_a_phase",), lambda k: k / ROOT_3, "Kv = Kv_phase/sqrt(3)", KRISHNAN),
        Relation("kv", ("torque_constant",), lambda k: 1.0 / k, "Kv = 1/kt, two phases on", KRISHNAN),
        Relation("torque_constant", ("kv",), lambda k: 1.0 / k, "kt = 1/Kv, two phases on", KRISHNAN),
        Relation("flux", ("kv", "pole_pairs"), lambda k, p: 1.0 / (ROOT_3 * p * k), "psi = 1/(sqrt(3) p Kv)", KRISHNAN),
        Relation(
            "flux",
            ("torque_constant_of_amplitude", "pole_pairs"),
            lambda k, p: k / (1.5 * p),
            "psi = kt/(3/2 p)",
            KRISHNAN,
        ),
        Relation(
            "flux",
            ("torque_constant_of_rms", "pole_pairs"),
            lambda k, p: k / (1.5 * p * math.sqrt(2.0)),
            "psi = kt_rms/(3/2 sqrt(2) p)",
            KRISHNAN,
        ),
        Relation("kv", ("flux", "pole_pairs"), lambda f, p: 1.0 / (ROOT_3 * p * f), "Kv = 1/(sqrt(3) p psi)", KRISHNAN),
        Relation(
            "no_load_speed",
            ("nominal_voltage", "phase_to_phase_resistance", "no_load_current", "kv"),
            lambda u, r, i, k: (u - r * i) * k,
            "n0 = (U - R_ab I0) Kv",
            KRISHNAN,
        ),
        Relation(
            "damping",
            ("torque_constant", "no_load_current", "no_load_speed"),
            lambda k, i, n: k * i / n,
            "b = kt I0/n0",
            KRISHNAN,
        ),
    ),
    parameters={
        "R_ohm": "phase_resistance",
        "Ld_H": "d_axis_inductance",
        "Lq_H": "q_axis_inductance",
        "flux_Wb": "flux",
        "pole_pairs": "pole_pairs",
        "J_kg_m2": "rotor_inertia",
        "b_N_m_s_rad": "damping",
    },
    tests={
        "phase_to_phase": StandardTest(("voltage_V", "current_A"), (), _between),
        "locked_d": StandardTest(RECORDING, (), _locked_d),
        "locked_q": StandardTest(RECORDING, (), _locked_q),
        "spin": StandardTest(("voltage_V", "speed_rad_s"), ("pole_pairs",), _spin),
        "alignment": StandardTest(("position_rad",), ("pole_pairs",), _aligned),
        "run_up": StandardTest(RECORDING, ("pole_pairs", "flux_Wb"), _run_up),
    },
    inputs=("voltage_d_V", "voltage_q_V"),
    outputs=("current_d_A", "current_q_A", "speed_rad_s", "position_rad"),
    slips=(
        ("phase to phase and one phase, or poles and pole pairs", "2", 2.0),
        ("a winding in delta and the star that acts like it", "3", 3.0),
    ),
)
