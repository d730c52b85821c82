"""What a brushed DC motor's datasheet prints, in the words of most makers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from firmloop.identify.bench_tests.datasheets import RECORDING, Relation, Sheet, StandardTest
from firmloop.identify.bench_tests.graphical import one_point
from firmloop.identify.bench_tests.standard_tests import (
    Measured,
    coast_down,
    locked_rotor_ac,
    locked_rotor_dc,
    no_load,
    step_test,
)
from firmloop.identify.bench_tests.step_response import step_response
from firmloop.identify.recordings.recording import Recording, column

MAXON = "maxon, Key information on DC motors, section on characteristic lines"
KRISHNAN = "R. Krishnan, Electric Motor Drives (2001), section 2.2"


def _gradient(resistance: float, constant: float) -> float:
    return float(resistance / constant**2)


def _efficiency(no_load: float, stall: float) -> float:
    return float((1.0 - (no_load / stall) ** 0.5) ** 2)


Known = Mapping[str, Measured]
Readings = Mapping[str, Sequence[float]]


def _doubt(known: Known, name: str) -> float:
    return known[name].deviation or 0.0


def _locked_dc(given: Readings, known: Known) -> Known:
    return locked_rotor_dc(given["voltage_V"], given["current_A"])


def _locked_ac(given: Readings, known: Known) -> Known:
    resistance = known["R_ohm"].value, _doubt(known, "R_ohm")
    return locked_rotor_ac(given["voltage_V"], given["current_A"], given["frequency_Hz"], *resistance)


def _no_load(given: Readings, known: Known) -> Known:
    resistance = known["R_ohm"].value, _doubt(known, "R_ohm")
    return no_load(given["voltage_V"], given["current_A"], given["speed_rad_s"], *resistance)


def _coast_down(given: Recording, known: Known) -> Known:
    friction, dry = known["b_N_m_s_rad"], known.get("coulomb_N_m", Measured(0.0, None))
    doubt = (friction.deviation or 0.0, dry.deviation or 0.0)
    return coast_down(given.time, column(given, "speed_rad_s"), friction.value, dry.value, doubt)


def _step(given: Recording, known: Known) -> Known:
    quick = one_point(step_response(given, "voltage_V", "speed_rad_s"))["time_constant_s"]
    return step_test(quick, {name: one.value for name, one in known.items()})


SHEET = Sheet(
    kind="dc_motor",
    figures={
        "nominal_voltage": "V",
        "no_load_speed": "rad/s",
        "no_load_current": "A",
        "nominal_speed": "rad/s",
        "nominal_torque": "N*m",
        "nominal_current": "A",
        "stall_torque": "N*m",
        "stall_current": "A",
        "terminal_resistance": "ohm",
        "terminal_inductance": "H",
        "torque_constant": "N*m/A",
        "back_emf_constant": "V*s/rad",
        "speed_constant": "rad/s/V",
        "speed_torque_gradient": "rad/s/N/m",
        "mechanical_time_constant": "s",
        "electrical_time_constant": "s",
        "rotor_inertia": "kg*m^2",
        "damping": "N*m*s/rad",
        "max_efficiency": "1",
    },
    relations=(
        Relation("torque_constant", ("back_emf_constant",), lambda ke: ke, "kt = ke in SI", KRISHNAN),
        Relation("torque_constant", ("speed_constant",), lambda kn: 1.0 / kn, "kt = 1/kn", MAXON),
        Relation("back_emf_constant", ("torque_constant",), lambda kt: kt, "ke = kt in SI", KRISHNAN),
        Relation("speed_constant", ("torque_constant",), lambda kt: 1.0 / kt, "kn = 1/kt", MAXON),
        Relation(
            "terminal_resistance",
            ("nominal_voltage", "stall_current"),
            lambda u, i: u / i,
            "R = U/I_stall",
            MAXON,
        ),
        Relation("stall_current", ("nominal_voltage", "terminal_resistance"), lambda u, r: u / r, "I = U/R", MAXON),
        Relation("stall_torque", ("torque_constant", "stall_current"), lambda kt, i: kt * i, "M = kt I_stall", MAXON),
        Relation(
            "torque_constant",
            ("stall_torque", "stall_current"),
            lambda m, i: m / i,
            "kt = M_stall/I_stall",
            MAXON,
        ),
        Relation(
            "no_load_speed",
            ("nominal_voltage", "terminal_resistance", "no_load_current", "back_emf_constant"),
            lambda u, r, i, ke: (u - r * i) / ke,
            "n0 = (U - R I0)/ke",
            KRISHNAN,
        ),
        Relation(
            "back_emf_constant",
            ("nominal_voltage", "terminal_resistance", "no_load_current", "no_load_speed"),
            lambda u, r, i, n: (u - r * i) / n,
            "ke = (U - R I0)/n0",
            KRISHNAN,
        ),
        Relation(
            "nominal_torque",
            ("torque_constant", "nominal_current", "no_load_current"),
            lambda kt, i, i0: kt * (i - i0),
            "M = kt (I - I0)",
            MAXON,
        ),
        Relation(
            "speed_torque_gradient",
            ("terminal_resistance", "torque_constant"),
            _gradient,
            "dn/dM = R/kt^2",
            MAXON,
        ),
        Relation(
            "mechanical_time_constant",
            ("rotor_inertia", "terminal_resistance", "torque_constant"),
            lambda j, r, kt: j * r / kt**2,
            "tau_m = J R/kt^2",
            MAXON,
        ),
        Relation(
            "rotor_inertia",
            ("mechanical_time_constant", "terminal_resistance", "torque_constant"),
            lambda tau, r, kt: tau * kt**2 / r,
            "J = tau_m kt^2/R",
            MAXON,
        ),
        Relation(
            "electrical_time_constant",
            ("terminal_inductance", "terminal_resistance"),
            lambda inductance, r: inductance / r,
            "tau_e = L/R",
            KRISHNAN,
        ),
        Relation(
            "terminal_inductance",
            ("electrical_time_constant", "terminal_resistance"),
            lambda tau, r: tau * r,
            "L = tau_e R",
            KRISHNAN,
        ),
        Relation(
            "max_efficiency",
            ("no_load_current", "stall_current"),
            _efficiency,
            "eta = (1 - sqrt(I0/I_stall))^2",
            MAXON,
        ),
        Relation(
            "damping",
            ("torque_constant", "no_load_current", "no_load_speed"),
            lambda kt, i, n: kt * i / n,
            "b = kt I0/n0",
            KRISHNAN,
        ),
    ),
    parameters={
        "R_ohm": "terminal_resistance",
        "L_H": "terminal_inductance",
        "ke_V_s_rad": "back_emf_constant",
        "kt_N_m_A": "torque_constant",
        "J_kg_m2": "rotor_inertia",
        "b_N_m_s_rad": "damping",
    },
    tests={
        "locked_rotor_dc": StandardTest(("voltage_V", "current_A"), (), _locked_dc),
        "locked_rotor_ac": StandardTest(("voltage_V", "current_A", "frequency_Hz"), ("R_ohm",), _locked_ac),
        "no_load": StandardTest(("voltage_V", "current_A", "speed_rad_s"), ("R_ohm",), _no_load),
        "coast_down": StandardTest(RECORDING, ("b_N_m_s_rad",), _coast_down),
        "step": StandardTest(RECORDING, ("R_ohm", "ke_V_s_rad", "kt_N_m_A", "b_N_m_s_rad"), _step),
    },
)
