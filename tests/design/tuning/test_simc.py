"""SIMC gives the settings that its author published (Skogestad, J. Process Control 13 (2003) 291-309)."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.design.analysis.loop import margins
from firmloop.design.kinds import design
from firmloop.design.law import DesignError
from firmloop.design.models.process import ZeroPole, half_rule, process, zero_pole
from firmloop.design.tuning.simc import simc, tune
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import Linear, linearize

NO_HOLD = 1e-12  # s: the published examples are continuous


def plant(gain: float, leads: list[float], lags: list[float], integrators: int, delay: float) -> ZeroPole:
    """gain prod(lead s + 1) / (s^integrators prod(lag s + 1)) exp(-delay s)."""
    factor = gain * np.prod(leads) / np.prod(lags)
    poles = np.array([-1 / lag for lag in lags] + [0] * integrators, dtype=np.complex128)
    return ZeroPole(float(factor), np.array([-1 / lead for lead in leads], dtype=np.complex128), poles, delay)


E1 = plant(1, [], [1, 0.2], 0, 0)
E2 = plant(1, [-0.3, 0.08], [2, 1, 0.4, 0.2, 0.05, 0.05, 0.05], 0, 0)
E3 = plant(2, [15], [20, 1, 0.1, 0.1], 0, 0)
E4 = plant(1, [], [1, 1, 1, 1], 0, 0)
E5 = plant(1, [], [1, 0.2, 0.04, 0.008], 0, 0)
E6 = plant(1, [0.17, 0.17], [1, 1, 0.028], 1, 0)
E7 = plant(1, [-2], [1, 1, 1], 0, 0)
E8 = plant(1, [-1], [6, 2, 2], 0, 1)
E9 = plant(1, [], [1, 1], 0, 1)
E10 = plant(1, [], [20, 2], 0, 1)


@pytest.mark.parametrize(
    ("model", "order", "kc", "tau_i", "tau_d"),
    [
        (E1, 1, 5.5, 0.8, 0),
        (E2, 1, 0.85, 2.5, 0),
        (E2, 2, 1.30, 2.0, 1.2),
        (E3, 1, 2.33, 1.05, 0),
        (E3, 2, 6.67, 0.4, 0.15),
        (E4, 1, 0.3, 1.5, 0),
        (E4, 2, 0.5, 1.5, 1.0),
        (E5, 1, 3.72, 1.1, 0),
        (E5, 2, 17.9, 0.224, 0.22),
        (E6, 1, 0.296, 13.5, 0),
        (E6, 2, 1.40, 2.86, 1.33),
        (E7, 1, 0.214, 1.5, 0),
        (E7, 2, 0.3, 1.5, 1.0),
        (E8, 1, 0.7, 7.0, 0),
        (E8, 2, 1.0, 6.0, 3.0),
        (E9, 1, 0.5, 1.5, 0),
        (E9, 2, 0.5, 1.0, 1.0),
        (E10, 1, 5.25, 16.0, 0),
        (E10, 2, 10.0, 8.0, 2.0),
        (plant(1, [], [], 2, 1), 2, 0.0625, 8.0, 8.0),
    ],
)
def test_published_settings(model, order, kc, tau_i, tau_d):
    reduced = half_rule(process(model, NO_HOLD), order)
    gains = simc(reduced, reduced.delay)
    series = (kc * (1 + tau_d / tau_i), kc / tau_i, kc * tau_d)
    assert (gains.kp, gains.ki, gains.kd) == pytest.approx(series, rel=0.006)  # the tables have three digits


def test_first_order_with_delay_by_the_formula():
    linear = Linear(np.array([[-1.0]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), 0.3)
    gains = tune(linear, 0.04, {"tau_c_s": 0.5})
    theta = 0.3 + 0.02  # half a sample of hold
    assert (gains.kp, gains.ki, gains.kd) == pytest.approx((1 / (0.5 + theta), 1 / (0.5 + theta), 0))


def dc_motor(output: str):
    values = {"R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}
    parameters = {name: {"value": value, "free": False} for name, value in values.items()}
    return make_plant("dc_motor", "voltage_V", [output], parameters)


def test_dc_motor_speed_gets_pi_and_position_gets_pid():
    period = 0.001
    speed, position = (
        tune(linearize(dc_motor(output)), period, {"tf_s": 0.0}) for output in ("speed_rad_s", "position_rad")
    )
    gain = 0.02 / (8 * 3e-6 + 0.02**2)
    electrical, mechanical = np.sort(-1 / np.linalg.eigvals([[-8e3, -20], [0.02 / 3e-6, -1]]))
    theta = period / 2 + electrical / 2
    assert speed.kd == 0
    assert speed.kp == pytest.approx((mechanical + electrical / 2) / (gain * 2 * theta), rel=1e-6)
    assert speed.ki == pytest.approx(speed.kp / min(mechanical + electrical / 2, 8 * theta), rel=1e-6)
    kc = 1 / (gain * 2 * theta)
    assert position.kd == pytest.approx(kc * (mechanical + electrical / 2), rel=1e-6)
    assert position.ki == pytest.approx(kc / (8 * theta), rel=1e-6)


@pytest.mark.parametrize(("output", "unit"), [("speed_rad_s", "rad/s"), ("position_rad", "rad"), ("current_A", "A")])
@pytest.mark.parametrize("table", [{}, {"tau_c_s": 0.004}, {"form": "tustin"}])
def test_tuned_motor_loops_are_robust(output, unit, table):
    inputs = (Signal("reference", unit, -400.0, 400.0), Signal("measurement", unit, -400.0, 400.0))
    motor = dc_motor(output)
    found = design(
        "pid", "motor", {"tune": "simc", **table}, 0.001, inputs, (Signal("output", "V", -12.0, 12.0),), motor
    )
    assert found.tuned_by == "simc"
    reached = margins(found.law, linearize(motor))
    assert reached.stable and reached.sensitivity_peak < 2.1 and reached.phase_margin_deg > 35


def test_the_filter_of_the_derivative_counts_as_delay():
    position = linearize(dc_motor("position_rad"))
    gains = tune(position, 0.001, {})
    assert gains.kd == pytest.approx(tune(position, 0.001, {"tf_s": gains.filter_time}).kd, rel=1e-6)
    assert gains.kd < tune(position, 0.001, {"tf_s": 0.0}).kd


@pytest.mark.parametrize("damping", [0.5, 0.6, 0.8, 0.95])
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.2])
def test_a_complex_pair_is_cancelled(damping, delay):
    w, period = 20.0, 0.001
    linear = Linear(
        np.array([[-2 * damping * w, -w * w], [1.0, 0.0]]),
        np.array([[1.0], [0.0]]),
        np.array([[0.0, -3.0 * w * w]]),
        np.zeros((1, 1)),
        delay,
    )
    gains = tune(linear, period, {"tau_c_s": 0.03, "tf_s": 0.004})
    ki = -1 / (3.0 * (0.03 + delay + period / 2 + 0.004))
    assert (gains.kp, gains.ki, gains.kd) == pytest.approx((2 * damping / w * ki, ki, ki / w**2))
    tuned = tune(linear, period, {})
    wires = tuple(Signal(name, "1", -1.0, 1.0) for name in ("reference", "measurement"))
    table = {"kp": tuned.kp, "ki": tuned.ki, "kd": tuned.kd}
    law = design("pid", "x", table, period, wires, (Signal("output", "1", -1.0, 1.0),), None).law
    reached = margins(law, linear)
    assert reached.stable and reached.sensitivity_peak < 1.8 and reached.phase_margin_deg > 55


@pytest.mark.parametrize(
    ("a", "c", "d", "words"),
    [
        ([[1.0, 0.0], [1.0, -2.0]], [[0.0, 1.0]], 0.0, "unstable"),
        ([[-0.2, -1.0], [1.0, 0.0]], [[0.0, 1.0]], 0.0, "rings"),
        ([[-1.0, 0.0], [0.0, -2.0]], [[0.0, 1.0]], 0.0, "does not answer"),
        ([[-3.0, -2.0], [1.0, 0.0]], [[1.0, 0.0]], 0.0, "gain 0 at rest"),
        ([[-3.0, -2.0], [1.0, 0.0]], [[-3.0, 2.0]], 1.0, "notch"),
    ],
)
def test_a_plant_outside_the_rules_is_refused(a, c, d, words):
    linear = Linear(np.array(a), np.array([[1.0], [0.0]]), np.array(c), np.array([[d]]), 0.0)
    with pytest.raises(DesignError, match=words):
        tune(linear, 0.001, {})


def test_double_integrator_needs_pid():
    linear = Linear(
        np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0], [0.0]]), np.array([[0.0, 1.0]]), np.zeros((1, 1)), 0.1
    )
    with pytest.raises(DesignError, match="terms = 'pid'"):
        tune(linear, 0.001, {"terms": "pi"})
    assert tune(linear, 0.001, {}).kd > 0


def test_a_mode_that_is_not_seen_is_left_out():
    linear = Linear(
        np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, -5.0]]),
        np.array([[2.0], [0.0], [0.0]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.zeros((1, 1)),
        0.0,
    )
    found = zero_pole(linear)
    assert found.poles == pytest.approx([-1.0]) and len(found.zeros) == 0 and found.factor == 2.0
