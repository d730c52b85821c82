"""Margins, poles, trajectories and step metrics agree with python-control's own answers."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from firmloop.design.analysis.loop import (
    BLOCK,
    LONGEST,
    LONGEST_SEARCHED,
    MOST_WORK,
    Trajectory,
    closed_loop,
    closed_loop_poles,
    loop_response,
    margins,
    samples_to_rest,
    step_profile,
)
from firmloop.design.analysis.step_metrics import step_metrics
from firmloop.design.kinds import design
from firmloop.design.law import DesignError, Law
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import Linear
from firmloop.quantize.twins.qp import optimum

Z = control.tf([1, 0], [1], True)


def pid(period: float, **table: object) -> Law:
    inputs = (Signal("reference", "1", -100.0, 100.0), Signal("measurement", "1", -100.0, 100.0))
    return design("pid", "loop", table, period, inputs, (Signal("output", "1", -1e3, 1e3),), None).law


def linear(numerator: list[float], denominator: list[float], delay: float) -> Linear:
    system = control.tf2ss(numerator, denominator)
    return Linear(system.A, system.B, system.C, system.D, delay)


def by_control(
    plant: Linear, period: float, samples: int, kp: float, ki: float, kd: float, tf: float
) -> control.TransferFunction:
    """The loop from the formulas: P sampled, C = kp + ki h/(z-1) + kd (z-1)/((tf+h) z - tf)."""
    sampled = control.tf(control.c2d(control.ss(plant.a, plant.b, plant.c, plant.d), period, "zoh"))
    z = control.tf([1, 0], [1], period)
    loop = kp + ki * period / (z - 1) + kd * (z - 1) / ((tf + period) * z - tf)
    return control.minreal(loop * sampled / z**samples, verbose=False)


CASES = [
    # numerator, denominator, whole samples of delay, period, gains
    ([1.0], [1.0, 1.0], 3, 0.05, {"kp": 2.0, "ki": 1.5, "kd": 0.0, "tf_s": 0.0}),
    ([2.0], [1.0, 3.0, 2.0], 0, 0.02, {"kp": 4.0, "ki": 3.0, "kd": 0.4, "tf_s": 0.05}),
    ([1.0], [1.0, 3.0, 3.0, 1.0], 2, 0.1, {"kp": 1.5, "ki": 0.6, "kd": 0.8, "tf_s": 0.1}),
    ([5.0], [1.0, 1.0, 0.0], 1, 0.02, {"kp": 0.6, "ki": 0.05, "kd": 0.2, "tf_s": 0.02}),
    ([-0.2, 1.0], [1.0, 0.4, 1.0], 0, 0.05, {"kp": 0.2, "ki": 0.3, "kd": 0.0, "tf_s": 0.0}),
    ([47.0], [7e-6, 0.0566, 1.0], 0, 0.001, {"kp": 0.11, "ki": 2.7, "kd": 0.0, "tf_s": 0.0}),
]


@pytest.mark.parametrize(("numerator", "denominator", "samples", "period", "gains"), CASES)
def test_margins(numerator, denominator, samples, period, gains):
    plant = linear(numerator, denominator, samples * period)
    law = pid(period, **gains)
    found = margins(law, plant)
    loop = by_control(plant, period, samples, *gains.values())
    frequency = np.geomspace(1e-3, 0.999, 50) * math.pi / period
    expected = loop(np.exp(1j * frequency * period))
    assert np.allclose(loop_response(law, plant, frequency), expected, rtol=1e-6)
    gain, phase, distance, _, crossover, _ = control.stability_margins(loop, method="frd")
    assert found.stable
    reached = 10 ** (found.gain_margin_db / 20)
    if math.isfinite(gain):
        assert found.gain_margin_db == pytest.approx(20 * math.log10(gain), rel=0.01)
    for factor in (0.99, 1.01):  # control does not look at Nyquist's frequency for a gain margin, its poles do
        poles = control.feedback(factor * reached * loop).poles()
        assert (np.abs(poles).max() < 1) == (factor < 1)
    assert found.phase_margin_deg == pytest.approx(phase, rel=0.01)
    assert found.crossover_rad_s == pytest.approx(crossover, rel=0.01)
    assert found.delay_margin_s == pytest.approx(math.radians(phase) / crossover, rel=0.01)
    assert found.sensitivity_peak == pytest.approx(1 / distance, rel=0.01)


@pytest.mark.parametrize(("numerator", "denominator", "samples", "period", "gains"), CASES)
def test_poles(numerator, denominator, samples, period, gains):
    plant = linear(numerator, denominator, samples * period)
    found = closed_loop_poles(pid(period, **gains), plant)
    expected = control.feedback(by_control(plant, period, samples, *gains.values())).poles()
    expected = expected[np.abs(expected) > 1e-3]
    for pole in expected:
        assert np.abs(found - pole).min() < 1e-3, pole
    assert np.abs(found).max() == pytest.approx(np.abs(expected).max(), rel=1e-4)


@pytest.mark.parametrize("growth", [-2e-6, 2e-6])
def test_a_loop_that_grows_or_decays_in_days_is_called_by_its_sign(growth: float) -> None:
    """An oscillator of 10 rad/s that a gain of 1e-9 leaves alone: its poles are 1e-9 off the circle."""
    found = margins(pid(0.001, kp=1e-9, ki=0.0), linear([100.0], [1.0, -growth, 100.0], 0.0))
    assert found.stable == (growth < 0.0)


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_the_gain_margin_is_where_the_loop_turns_unstable(factor):
    plant, period = linear([1.0], [1.0, 3.0, 3.0, 1.0], 0.17), 0.1
    reached = margins(pid(period, kp=1.0, ki=0.2), plant)
    gain = factor * 10 ** (reached.gain_margin_db / 20)
    scaled = margins(pid(period, kp=gain, ki=0.2 * gain), plant)
    assert scaled.stable == (factor < 1)
    if not scaled.stable:
        assert scaled.gain_margin_db == pytest.approx(20 * math.log10(1 / factor), rel=0.05)
        assert scaled.delay_margin_s == 0 and scaled.sensitivity_peak == math.inf and scaled.phase_margin_deg < 0


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_the_delay_margin_is_where_the_loop_turns_unstable(share):
    plant, law = linear([1.0], [1.0, 1.0], 0.013), pid(0.01, kp=8.0, ki=12.0)
    reached = margins(law, plant).delay_margin_s
    assert 0 < reached < math.inf
    later = Linear(plant.a, plant.b, plant.c, plant.d, plant.delay + share * reached)
    assert margins(law, later).stable == (share < 1)


def test_no_crossing_is_an_infinite_margin():
    found = margins(pid(0.01, kp=0.5), linear([1.0], [1.0, 1.0], 0.0))
    assert found.stable and found.phase_margin_deg == found.delay_margin_s == math.inf
    assert math.isnan(found.crossover_rad_s)


def test_positive_feedback_is_unstable_and_said():
    found = margins(pid(0.01, kp=-2.0), linear([1.0], [1.0, 1.0], 0.0))
    assert not found.stable and found.gain_margin_db == pytest.approx(20 * math.log10(0.5), rel=0.01)


def test_a_one_sided_output_is_linearized_inside_its_limits():
    inputs = (Signal("reference", "degC", 10.0, 90.0), Signal("measurement", "degC", 0.0, 100.0))
    outputs = (Signal("heat", "W", 0.0, 50.0),)
    law = design("pid", "oven", {"kp": 3.0, "ki": 0.2}, 1.0, inputs, outputs, None).law
    found = margins(law, linear([0.8], [40.0, 1.0], 3.0))
    loop = by_control(linear([0.8], [40.0, 1.0], 0.0), 1.0, 3, 3.0, 0.2, 0.0, 0.0)
    gain, phase, *_ = control.stability_margins(loop, method="frd")
    assert found.gain_margin_db == pytest.approx(20 * math.log10(gain), rel=0.01)
    assert found.phase_margin_deg == pytest.approx(phase, rel=0.01)


@pytest.mark.parametrize(("numerator", "denominator", "samples", "period", "gains"), CASES)
def test_trajectory_and_step_metrics(numerator, denominator, samples, period, gains):
    plant = linear(numerator, denominator, samples * period)
    law = pid(period, **gains, c=1.0)
    loop = by_control(plant, period, samples, *gains.values())
    reference = np.ones(4000)
    found = closed_loop(law, plant, reference)
    assert not found.saturated.any()
    if not gains["kd"]:  # the law has no derivative at its first sample, the linear loop has
        expected = control.step_response(control.ss(control.feedback(loop)), found.time).outputs
        assert np.allclose(found.measurement, expected, atol=1e-6)
    info = control.step_info(found.measurement, T=found.time, yfinal=found.measurement[-1])
    ours = step_metrics(found)
    assert ours.rise_s == pytest.approx(info["RiseTime"], rel=0.01, abs=1.01 * period)  # control's is in whole samples
    assert ours.settling_2_s == pytest.approx(info["SettlingTime"], rel=0.01, abs=1.01 * period)
    assert ours.overshoot_percent == pytest.approx(info["Overshoot"], rel=0.01, abs=1e-6)
    assert ours.undershoot_percent == pytest.approx(info["Undershoot"], rel=0.01, abs=1e-6)
    assert ours.steady_state_error == pytest.approx(0, abs=1e-3)
    assert ours.iae == pytest.approx(np.abs(1 - found.measurement)[:-1].sum() * period)
    assert ours.settling_5_s <= ours.settling_2_s


def test_step_metrics_of_a_response_that_is_known():
    time = np.arange(0, 20, 1e-3)
    wn, zeta = 2.0, 0.5
    damped = wn * math.sqrt(1 - zeta**2)
    y = 1 - np.exp(-zeta * wn * time) * (np.cos(damped * time) + zeta * wn / damped * np.sin(damped * time))
    found = step_metrics(Trajectory(time, np.full(len(time), 1.0), y, y, np.zeros(len(time), dtype=bool)))
    assert found.overshoot_percent == pytest.approx(100 * math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-4)
    assert found.peak == pytest.approx(1 + found.overshoot_percent / 100, rel=1e-4)
    growing = Trajectory(
        time, np.full(len(time), 1.0), np.sin(5 * time) * np.exp(time / 4), y, np.zeros(len(time), dtype=bool)
    )
    assert step_metrics(growing).settling_2_s == math.inf


def test_saturation_holds_and_is_flagged():
    inputs = (Signal("reference", "1", -9.0, 9.0), Signal("measurement", "1", -9.0, 9.0))
    law = design("pid", "x", {"kp": 5.0, "ki": 5.0}, 0.01, inputs, (Signal("output", "1", -1.5, 1.5),), None).law
    found = closed_loop(law, linear([1.0], [1.0, 1.0], 0.0), np.full(2000, 1.2))
    assert found.output.max() == 1.5 and found.saturated[0] and not found.saturated[-1]
    assert found.measurement[-1] == pytest.approx(1.2, rel=1e-3)


def test_step_profile_lasts_until_the_loop_has_settled():
    law, plant = pid(0.05, kp=2.0, ki=1.5), linear([1.0], [1.0, 1.0], 0.15)
    profile = step_profile(law, plant)
    assert np.all(profile == 25.0)
    assert step_metrics(closed_loop(law, plant, profile)).settling_2_s < 0.8 * len(profile) * 0.05


def test_a_run_in_blocks_is_one_run():
    law, plant = pid(0.05, kp=2.0, ki=1.5), linear([1.0], [1.0, 1.0], 0.15)
    reference = np.full(2 * BLOCK + 7, 25.0)
    whole, first = closed_loop(law, plant, reference), closed_loop(law, plant, reference[: BLOCK - 1])
    assert len(whole.measurement) == len(reference) and np.all(whole.measurement[-7:] == pytest.approx(25.0))
    assert np.array_equal(whole.measurement[: BLOCK - 1], first.measurement)


@pytest.mark.parametrize("samples", [10, 250])
def test_a_step_is_bounded_in_samples_and_work(samples: int):
    """A plant that rests after millions of samples; its delay makes each of them dearer."""
    law, plant = pid(0.005, kp=1.0, ki=1e-3), linear([1.0], [1e6, 1e3, 1.0], 0.005 * samples)
    assert samples_to_rest(law, plant) > 1e6
    length = len(step_profile(law, plant))
    assert length == LONGEST if samples == 10 else LONGEST / 3 < length < MOST_WORK / samples


def test_a_response_that_does_not_rest_has_no_last_value():
    time = np.arange(100.0)
    growing = Trajectory(time, np.r_[0.0, np.ones(99)], time**8, time, np.zeros(100, dtype=bool))
    ramp = step_metrics(growing)
    assert ramp.rise_s == ramp.settling_5_s == math.inf and math.isnan(ramp.overshoot_percent)


def test_a_delay_of_too_many_samples_is_refused_with_the_period_that_does():
    with pytest.raises(DesignError, match=r"4000 samples of controller.period_s = 0.005.*a period of 1 s does"):
        margins(pid(0.005, kp=1.0), linear([1.0], [10.0, 1.0], 20.0))


def test_a_law_that_is_never_free_is_refused():
    inputs = (Signal("reference", "1", 5.0, 9.0), Signal("measurement", "1", 5.0, 9.0))
    outputs = (Signal("output", "1", -1.5, 1.5),)
    law = design("pid", "x", {"kp": 50.0, "b": 0.0}, 0.01, inputs, outputs, None).law
    with pytest.raises(DesignError, match="stands at a limit"):
        margins(law, linear([1.0], [1.0, 1.0], 0.0))


def test_a_law_that_searches_steps_for_a_bounded_number_of_samples() -> None:
    """Twelve time constants of the loop are a hundred thousand samples, each as dear as many of a PID."""
    pole = math.exp(-1e-4)
    table = {"A": [[pole]], "B": [[1.0 - pole]], "Q": [1.0], "R": 1e6, "horizon": 3}
    table |= {"u_min": -1.0, "u_max": 1.0, "reference": "reference"}
    wires = (Signal("reference", "1", -1.0, 1.0), Signal("measurement", "1", -1.0, 1.0))
    law = design("mpc", "loop", table, 1.0, wires, (Signal("output", "1", -1.0, 1.0),), None, optimum).law
    assert len(step_profile(law, linear([1.0], [1e4, 1.0], 0.0))) == LONGEST_SEARCHED
