"""LQR, Kalman and pole placement against python-control, and what the state_feedback kind makes of them."""

from __future__ import annotations

import control
import numpy as np
import pytest

from firmloop.design.analysis.loop import closed_loop, closed_loop_poles, margins
from firmloop.design.discretize.zero_order_hold import zero_order_hold
from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.design.models.regulator import kalman, lqr, luenberger, reference_gain
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize

A = np.array([[1.0, 0.01, 0.0], [0.0, 0.9, 0.3], [0.0, -0.1, 0.7]])
B = np.array([[0.0], [0.02], [0.1]])
C = np.array([[1.0, 0.0, 0.0]])
Q, R = np.diag([10.0, 0.1, 0.0]), np.array([[0.2]])
MOTOR = {
    **{"R_ohm": 8.0, "L_H": 0.001, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6},
}
WIRES = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
VOLTS = (Signal("output", "V", -12.0, 12.0),)


def test_lqr_is_dlqr() -> None:
    np.testing.assert_allclose(lqr(A, B, Q, R, "Q and R"), control.dlqr(A, B, Q, R)[0], rtol=1e-6)


def test_kalman_is_dlqe() -> None:
    w, v = np.diag([1e-4, 1e-3, 1e-2]), np.array([[0.5]])
    np.testing.assert_allclose(kalman(A, C, w, v), control.dlqe(A, np.eye(3), C, w, v)[0], rtol=1e-6)


@pytest.mark.parametrize("poles", [(0.5, 0.5, 0.5), (0.2, 0.3, -0.1)])
def test_luenberger_places_the_poles(poles: tuple[float, ...]) -> None:
    found = A - luenberger(A, C, poles) @ C
    np.testing.assert_allclose(np.poly(found), np.poly(poles), atol=1e-9)
    both = np.vstack([C, [[0.0, 1.0, 0.0]]])
    spread = (0.5, 0.4, 0.3)
    found = np.sort(np.linalg.eigvals(A - luenberger(A, both, spread) @ both).real)
    np.testing.assert_allclose(found, sorted(spread), atol=1e-6)


def test_the_reference_is_reached_at_rest() -> None:
    gain = lqr(A, B, Q, R, "Q and R")
    forward = reference_gain(A, B, C, gain)
    x = np.zeros((3, 1))
    for _ in range(4000):
        x = A @ x + B @ (forward[:, None] * 0.7 - gain @ x)
    assert (C @ x).item() == pytest.approx(0.7, abs=1e-6)


def loop(law: Law, load: float) -> float:
    """Return the motor's speed after 2 s at a reference of 100 rad/s, `load` V of the drive lost."""
    sample = law.last.function
    speed = current = 0.0
    x = np.array(law.start)
    for _ in range(2000):
        x, u, _, _ = sample(x, [100.0, speed])
        for _ in range(20):
            current += law.period / 20 * (float(u) - load - 8.0 * current - 0.02 * speed) / 0.001
            speed += law.period / 20 * (0.02 * current - 3e-6 * speed) / 3e-6
    return speed


@pytest.mark.parametrize(
    ("table", "error"),
    [
        ({"observer": "luenberger", "observer_poles": [0.2, 0.6], "Q": [0.0, 1e-4], "R": 0.1}, 3.0),
        (
            {
                **{"observer": "kalman", "process_noise": [1e-4, 1.0], "measurement_noise": 1.0},
                **{"Q": [0.0, 1e-4], "R": 0.1, "integral_weight": 0.5},
            },
            0.01,
        ),
    ],
)
def test_a_plant_gives_the_model(table: dict[str, object], error: float) -> None:
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR)
    law = design("state_feedback", "x", table, 0.001, WIRES, VOLTS, plant).law
    assert loop(law, 0.0) == pytest.approx(100.0, abs=0.2)
    assert loop(law, 0.5) == pytest.approx(100.0, abs=30.0 if error > 1 else 0.2)
    assert all(np.isfinite([signal.low, signal.high]).all() for signal in law.state)


def test_measured_states_need_no_memory() -> None:
    wires = (Signal("position", "m", -1.0, 1.0), Signal("speed", "m/s", -2.0, 2.0))
    table = {"K": [[3.0, 1.5]]}
    law = design("state_feedback", "x", table, 0.01, wires, (Signal("force", "N", -9.0, 9.0),), None).law
    assert law.state == () and float(law.last.function([], [0.5, -1.0])[1]) == 0.0
    assert float(law.last.function([], [1.0, 1.0])[1]) == -4.5


def test_a_delayed_plant_keeps_its_past_inputs() -> None:
    plant = make_plant("first_order", "drive", ["y"], {"gain": 2.0, "time_constant_s": 0.1, "delay_s": 0.025})
    wires = (Signal("reference", "1", -5.0, 5.0), Signal("measurement", "1", -5.0, 5.0))
    table = {"Q": 1.0, "R": 0.1, "observer": "luenberger", "observer_poles": [0.5]}
    law = design("state_feedback", "x", table, 0.01, wires, (Signal("output", "1", -4.0, 4.0),), plant).law
    assert [signal.name for signal in law.state] == ["y_est", "past_1", "past_2", "past_3"]
    assert law.state[1].high == pytest.approx(4.04)


def test_margins_of_measured_states_are_those_of_the_whole_feedback() -> None:
    """An LQR sampled fast keeps |1 + L| near or above 1; the poles are those of A - B K."""
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR)
    wires = (WIRES[0], Signal("current", "A", -2.0, 2.0), Signal("speed", "rad/s", -400.0, 400.0))
    law = design("state_feedback", "x", {"Q": [0.0, 1e-4], "R": 0.1}, 1e-4, wires, VOLTS, plant).law
    linear = linearize(plant)
    model = zero_order_hold(linear, 1e-4)
    gain = lqr(model.a, model.b_now, np.diag([0.0, 1e-4]), np.array([[0.1]]), "Q and R")
    expected = np.sort_complex(np.linalg.eigvals(model.a - model.b_now @ gain))
    np.testing.assert_allclose(np.sort_complex(closed_loop_poles(law, linear)), expected, rtol=1e-6)
    found = margins(law, linear)
    assert found.stable and found.phase_margin_deg > 55 and found.sensitivity_peak < 1.1
    run = closed_loop(law, linear, np.full(4000, 50.0))
    assert run.measurement[-1] == pytest.approx(50.0, abs=0.01)


def test_a_schedule_on_the_measurement_has_margins() -> None:
    plant = linearize(
        make_plant("first_order", "drive", ["y"], {"gain": 30.0, "time_constant_s": 0.1, "delay_s": 0.002})
    )
    gains = {"kp": 0.05, "ki": 1.0}
    one = design("pid", "x", gains, 0.001, WIRES, VOLTS, None).law
    table = {"schedule_on": "measurement", "points": [0.0, 200.0], "controllers": [gains, {"kp": 0.0501, "ki": 1.0}]}
    other = design("gain_schedule", "x", table, 0.001, WIRES, VOLTS, None).law
    assert margins(other, plant).phase_margin_deg == pytest.approx(margins(one, plant).phase_margin_deg, abs=0.5)
