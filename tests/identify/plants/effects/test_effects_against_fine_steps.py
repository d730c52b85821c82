"""Each effect against a motor that is integrated by tiny explicit steps, at a realistic size."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from fine_motor import KE, KT, NOMINAL, Array, L, Motor, R, State

from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.superset import Superset, superset

OUTPUTS = ("speed_rad_s", "position_rad", "current_A")
ROWS = 120
TIME = np.arange(ROWS) * 1e-3
DRAWN = np.random.default_rng(3).uniform(-6.0, 6.0, 8)
VOLTAGE = np.repeat([*DRAWN[:5], 0.3, 0.0, *DRAWN[5:], 1.5, -1.5], 10)[:ROWS]
COPPER = 0.00393


def held(t: float) -> float:
    """Return the voltage that row times hold."""
    return float(VOLTAGE[min(max(int(np.searchsorted(TIME, t, side="right")) - 1, 0), ROWS - 1)]) if t >= 0.0 else 0.0


def plain(states: Array) -> Array:
    """Show speed, angle and current."""
    return states[:, [1, 2, 0]]


@dataclass
class Case:
    """One effect: parameters as the library names them, and the same thing said to the fine motor."""

    parameters: dict[str, float]
    motor: Callable[[], Motor] = Motor
    shown: Callable[[Array], Array] = plain
    voltage: Callable[[float], float] = held
    moments: Array = field(default_factory=lambda: TIME)
    reads: Array = field(default_factory=lambda: TIME)
    tolerance: float = 2e-4  # of what the effect changes


def contact(x: State) -> float:
    """Force of a flank: 0.05 rad to either side, 2 N m/rad, 1e-4 N m s/rad, only pushing."""
    pressed, side = abs(x[4]) - 0.05, math.copysign(1.0, x[4])
    push = 2.0 * pressed + 1e-4 * side * (x[1] - x[3])
    return side * push if pressed > 0.0 and push > 0.0 else 0.0


def twist(x: State) -> float:
    """Torque of a coupling."""
    return 2.0 * x[4] + 1e-4 * (x[1] - x[3])


def slewed(rate: float) -> tuple[Callable[[float], float], Array]:
    """Follow the held voltage no faster than `rate`; return the function and the moments where it bends."""
    knots, value = [(0.0, 0.0)], 0.0
    for begin, end, target in zip(TIME, [*TIME[1:], TIME[-1] + 1.0], VOLTAGE, strict=True):
        needed = abs(target - value) / rate
        if needed >= end - begin:
            value += math.copysign(rate * (end - begin), target - value)
            knots.append((end, value))
        else:
            knots.append((begin + needed, target))
            knots.append((end, target))
            value = target
    times, values = np.array(knots).T
    inside = times[(times > 0.0) & (times < TIME[-1])]
    return lambda t: float(np.interp(t, times, values)), np.unique(np.round(np.concatenate([TIME, inside]), 12))


def one_shown(column: int, change: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Change one output."""

    def show(states: Array) -> Array:
        outputs = plain(states).copy()
        outputs[:, column] = change(outputs[:, column])
        return outputs

    return show


def eccentric(states: Array) -> Array:
    """Show the speed of a disc that runs out of true."""
    outputs = plain(states).copy()
    outputs[:, 0] += 0.02 * np.cos(states[:, 2] + 0.3) * states[:, 1]
    outputs[:, 1] += 0.02 * np.sin(states[:, 2] + 0.3)
    return outputs


RAMP, BENDS = slewed(1500.0)
DELAY = 2.3e-3


def dry(level: Callable[[State, int], float]) -> Callable[[], Motor]:
    """Return a motor with dry friction."""
    return lambda: Motor(level=level)


def pushed(torque: Callable[[State, float, int], float]) -> Callable[[], Motor]:
    """Return a motor with another torque."""
    return lambda: Motor(torque=torque)


CASES = {
    "coulomb_friction": Case({"torque_N_m": 6e-3}, dry(lambda x, s: 6e-3)),
    "stribeck_friction": Case(
        {"coulomb_N_m": 3e-3, "static_N_m": 7e-3, "stribeck_rad_s": 8.0},
        dry(lambda x, s: 3e-3 + 4e-3 * math.exp(-((x[1] / 8.0) ** 2))),
    ),
    "asymmetric_friction": Case(
        {"positive_N_m": 3e-3, "negative_N_m": 6e-3}, dry(lambda x, s: 3e-3 if s > 0 else 6e-3)
    ),
    "load_dependent_friction": Case({"ratio": 0.2}, dry(lambda x, s: 0.2 * abs(KT * x[0]))),
    "presliding_friction": Case(
        {"stiffness_N_m_rad": 2.0, "coulomb_N_m": 5e-3},
        lambda: Motor(
            torque=lambda x, t, s: -x[3], extra=lambda x: [2.0 * (x[1] - abs(x[1]) * x[3] / 5e-3), 0.0, 0.0]
        ),
    ),
    "quadratic_drag": Case({"coefficient_N_m_s2_rad2": 1e-6}, pushed(lambda x, t, s: -1e-6 * abs(x[1]) * x[1])),
    "load_torque": Case({"torque_N_m": 4e-3}, pushed(lambda x, t, s: -4e-3)),
    "load_step": Case(
        {"torque_N_m": 4e-3, "time_s": 0.0534},
        pushed(lambda x, t, s: -4e-3 if t > 0.0534 - 1e-12 else 0.0),
        moments=np.sort(np.append(TIME, 0.0534)),
        tolerance=1e-3,
    ),
    "gravity_torque": Case(
        {"amplitude_N_m": 8e-3, "phase_rad": 0.4}, pushed(lambda x, t, s: -8e-3 * math.sin(x[2] + 0.4))
    ),
    "cogging_torque": Case(
        {"amplitude_N_m": 8e-3, "periods_per_rev": 12.0, "phase_rad": 0.4},
        pushed(lambda x, t, s: -8e-3 * math.sin(12.0 * x[2] + 0.4)),
    ),
    "torque_ripple": Case(
        {"ratio": 0.1, "periods_per_rev": 12.0, "phase_rad": 0.4},
        pushed(lambda x, t, s: -0.1 * KT * x[0] * math.sin(12.0 * x[2] + 0.4)),
    ),
    "end_stop": Case(
        {"position_rad": -0.1, "stiffness_N_m_rad": 0.5},
        pushed(lambda x, t, s: -0.5 * (x[2] + 0.1) if x[2] < -0.1 else 0.0),
    ),
    "end_stops": Case(
        {"low_rad": -0.1, "high_rad": 0.6, "stiffness_N_m_rad": 0.5, "damping_N_m_s_rad": 2e-4},
        pushed(
            lambda x, t, s: (
                max(-0.5 * (x[2] + 0.1) - 2e-4 * x[1], 0.0)
                if x[2] < -0.1
                else min(-0.5 * (x[2] - 0.6) - 2e-4 * x[1], 0.0)
                if x[2] > 0.6
                else 0.0
            )
        ),
    ),
    "return_spring": Case({"stiffness_N_m_rad": 0.01}, pushed(lambda x, t, s: -0.01 * x[2])),
    "hardening_spring": Case({"cubic_N_m_rad3": 0.01}, pushed(lambda x, t, s: -0.01 * x[2] ** 3)),
    "flexible_coupling": Case(
        {"stiffness_N_m_rad": 2.0, "load_inertia_kg_m2": 1e-5, "damping_N_m_s_rad": 1e-4},
        lambda: Motor(
            torque=lambda x, t, s: -twist(x), extra=lambda x: [twist(x) / 1e-5, x[1] - x[3], 0.0]
        ),
    ),
    "backlash": Case(
        {"gap_rad": 0.1, "load_inertia_kg_m2": 1e-5, "stiffness_N_m_rad": 2.0, "damping_N_m_s_rad": 1e-4},
        lambda: Motor(
            torque=lambda x, t, s: -contact(x), extra=lambda x: [contact(x) / 1e-5, x[1] - x[3], 0.0]
        ),
        tolerance=1e-2,  # where a flank is met the force jumps, and a step that holds the jump is of first order
    ),
    "torque_constant_saturation": Case(
        {"current_A": 2.0}, lambda: Motor(current_torque=lambda i: KT * i / (1.0 + (i / 2.0) ** 2))
    ),
    "resistance_heating": Case(
        {"rise_K_per_W": 20.0, "time_constant_s": 0.3},
        lambda: Motor(
            voltage=lambda x: -R * COPPER * x[3] * x[0],
            extra=lambda x: [(20.0 * R * (1.0 + COPPER * x[3]) * x[0] ** 2 - x[3]) / 0.3, 0.0, 0.0],
        ),
    ),
    "brush_drop": Case({"voltage_V": 0.5}, lambda: Motor(brush=0.5)),
    "current_limit": Case({"current_A": 1.2}, lambda: Motor(limit=1.2)),
    "freewheeling": Case({"share": 1.0}, lambda: Motor(diode=True)),
    "inductance_saturation": Case(
        {"current_A": 2.0},
        lambda: Motor(inverse_inductance=lambda i: (1.0 + (i / 2.0) ** 2) / L),
        tolerance=2e-3,
    ),
    "supply_sag": Case({"source_ohm": 0.4}, lambda: Motor(voltage=lambda x: -0.4 * x[0])),
    "dead_zone": Case({"half_width_V": 0.8}, voltage=lambda t: held(t) - min(max(held(t), -0.8), 0.8)),
    "input_saturation": Case({"limit_V": 3.0}, voltage=lambda t: min(max(held(t), -3.0), 3.0)),
    "slew_rate_limit": Case({"rate_V_s": 1500.0}, voltage=RAMP, moments=BENDS),
    "input_delay": Case(
        {"delay_s": DELAY}, voltage=lambda t: held(t - DELAY), moments=np.concatenate([[0.0], TIME + DELAY])
    ),
    "sensor_offset": Case({"offset_rad_s": 3.0}, shown=one_shown(0, lambda y: y + 3.0)),
    "sensor_gain": Case({"gain": 1.1}, shown=one_shown(0, lambda y: 1.1 * y)),
    "sensor_lag": Case(
        {"time_constant_s": 2e-3},
        lambda: Motor(extra=lambda x: [(x[1] - x[3]) / 2e-3, 0.0, 0.0]),
        shown=lambda x: x[:, [3, 2, 0]],
    ),
    "sensor_quantization": Case(
        {"resolution_rad_s": 4.0}, shown=one_shown(0, lambda y: 4.0 * np.floor(y / 4.0 + 0.5)), tolerance=1e-6
    ),
    "sensor_rectified": Case({"share": 1.0}, shown=one_shown(0, np.abs)),
    "sensor_delay": Case({"delay_s": 0.4e-3}, reads=np.sort(np.concatenate([TIME, TIME[1:] - 0.4e-3]))),
    "sensor_saturation": Case({"limit_rad_s": 30.0}, shown=one_shown(0, lambda y: np.clip(y, -30.0, 30.0))),
    "sensor_wrap": Case(
        {"range_rad_s": 40.0, "start": -0.5}, shown=one_shown(0, lambda y: (y + 20.0) % 40.0 - 20.0)
    ),
    "eccentric_encoder": Case({"amplitude_rad": 0.02, "phase_rad": 0.3}, shown=eccentric),
    "clock_skew": Case({"ratio": -0.03}, reads=TIME * 0.97),
}  # fmt: skip


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Voltage steps, large ones, small ones and a rest."""
    still = np.zeros(ROWS)
    return make_recording(TIME, {"voltage_V": VOLTAGE, **{name: still for name in OUTPUTS}}, "fine", "")


@pytest.fixture(scope="module")
def motor() -> Superset:
    """The motor with every effect it can have."""
    parameters = {name: {"value": value} for name, value in NOMINAL.items()}
    return superset(make_plant("dc_motor", "voltage_V", OUTPUTS, parameters))


def named(motor: Superset, name: str, parameters: dict[str, float]) -> dict[str, float]:
    """Find the full names of an effect's parameters: on the first output, for a disc on both."""
    found = {}
    for full in motor.names:
        label, _, last = full.rpartition(".")
        if label.partition(".")[0] == name and last in parameters and ("." not in label or speed_or_disc(label, name)):
            found[full] = parameters[last]
    return found


def speed_or_disc(label: str, name: str) -> bool:
    """Tell whether a sensor effect sits where the cases put it."""
    return label.endswith(".speed_rad_s") or (name == "eccentric_encoder" and label.endswith(".position_rad"))


def test_every_effect_of_a_motor_has_a_case(motor: Superset) -> None:
    axes = {name for name, effect in effects().items() if effect.place == "axes"}
    others = {"overflow", "capacitor_ageing", "magnetizing_saturation", "dead_time"}
    assert set(effects()) - set(CASES) == axes | others, (
        "tanks, capacitors, iron, bridges and axes have their own tests"
    )
    assert {name.partition(".")[0] for name in motor.names if "." in name} == set(CASES)


def test_nominal_motor(motor: Superset, recording: Recording) -> None:
    truth = plain(Motor().run(TIME, held, TIME))
    found = motor.simulate(recording, {}, None)
    assert np.allclose(found, truth, rtol=0.0, atol=1e-8 * np.abs(truth).max(axis=0))


@pytest.mark.parametrize("name", CASES)
def test_effect(name: str, motor: Superset, recording: Recording) -> None:
    case = CASES[name]
    states = case.motor().run(case.moments, case.voltage, case.reads)
    truth = case.shown(states)
    if name == "sensor_delay":
        now, late = np.isin(case.reads, TIME), np.isin(case.reads, np.concatenate([[0.0], TIME[1:] - 0.4e-3]))
        truth = np.column_stack([plain(states)[late, 0], plain(states)[now, 1:]])
    parameters = named(motor, name, case.parameters)
    assert len(parameters) >= len(case.parameters)
    found, without = motor.simulate(recording, parameters, None), motor.simulate(recording, {}, None)
    size, error = (np.sqrt(np.mean((shown - truth) ** 2, axis=0)) for shown in (without, found))
    assert size.max() > 1e-3, "the effect shows"
    assert np.all(error <= case.tolerance * size + 1e-7), f"{error / size} of what the effect changes"


def test_torque_and_back_emf_agree_at_speed(motor: Superset, recording: Recording) -> None:
    """A check of the case itself: at constant voltage the fine motor runs up to u / ke less the loss."""
    states = Motor().run(np.array([0.0, 1.5]), lambda t: 6.0, np.array([1.5]))
    assert states[0, 1] == pytest.approx(6.0 / (KE + R * 1e-5 / KT), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("stribeck_friction", {"coulomb_N_m": 0.005, "static_N_m": 0.00501, "stribeck_rad_s": 1e-5}),
        ("presliding_friction", {"coulomb_N_m": 0.005, "stiffness_N_m_rad": 2e3}),
    ],
)
def test_a_friction_as_steep_as_coulombs_is_coulombs(
    name: str, parameters: dict[str, float], motor: Superset, recording: Recording
) -> None:
    """Steps are fine only where such a friction changes: taken so fine throughout, they would never end."""
    coulomb = {"coulomb_friction.torque_N_m": 0.005}
    found, limit, without = (
        motor.simulate(recording, each, None) for each in (named(motor, name, parameters), coulomb, {})
    )
    apart, size = (np.sqrt(np.mean((shown - limit) ** 2, axis=0)) for shown in (found, without))
    assert np.all(apart <= 5e-3 * size), f"{apart / size} of what the friction changes"


@pytest.mark.parametrize(
    ("name", "parameters", "share"),
    [
        ("backlash", CASES["backlash"].parameters, 1e-9),
        ("end_stop", {**CASES["end_stop"].parameters, "damping_N_m_s_rad": 2e-4}, 1e-9),
        ("end_stops", CASES["end_stops"].parameters, 1e-9),
        ("inductance_saturation", {"current_A": 0.5}, 5e-2),
    ],
)
def test_long_steps_do(name: str, parameters: dict[str, float], share: float, recording: Recording) -> None:
    """Flanks that are pressed are part of what is exact, however stiff; no step is too long for a saturated iron."""
    engine = superset(make_plant("dc_motor", "voltage_V", OUTPUTS, {k: {"value": v} for k, v in NOMINAL.items()}))
    found = []
    for longest in (1.0, 0.1):
        engine.hasten(longest)
        found.append(engine.simulate(recording, named(engine, name, parameters), None))
    without = engine.simulate(recording, {}, None)
    error, size = (np.sqrt(np.mean((other - found[1]) ** 2, axis=0)) for other in (found[0], without))
    assert np.all(error <= share * size), f"{error / size} of what the effect changes"
