"""A step response is found, measured and read off as its formula says; what is no step is refused in a sentence."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from firmloop.identify.bench_tests.graphical import METHODS, one_point, overshoot, sundaresan, two_point
from firmloop.identify.bench_tests.step_noise import noise_halves
from firmloop.identify.bench_tests.step_response import step_figures, step_response
from firmloop.identify.bench_tests.trials import repeated
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import make_recording

TIME = np.arange(4000) * 1e-3
STEP = np.where(TIME >= 0.5, 12.0, 2.0)


def recorded(output: np.ndarray, drive: np.ndarray = STEP, noise: float = 0.0, seed: int = 1):
    output = output + noise * np.random.default_rng(seed).standard_normal(len(output))
    return make_recording(TIME[: len(output)], {"voltage_V": drive, "speed_rad_s": output}, "run.csv", "")


def lag(gain: float, tau: float, delay: float = 0.0) -> np.ndarray:
    since = np.clip(TIME - 0.5 - delay, 0.0, None)
    return 2.0 * gain + 10.0 * gain * (1 - np.exp(-since / tau))


def pair(gain: float, natural: float, zeta: float) -> np.ndarray:
    system = control.tf([gain * natural**2], [1, 2 * zeta * natural, natural**2])
    rest = TIME[TIME >= 0.5 - 1e-9]
    answer = control.step_response(system, rest - rest[0]).outputs
    return np.concatenate([np.full(len(TIME) - len(rest), 2.0 * gain), 2.0 * gain + 10.0 * answer])


def measured(recording):
    return step_response(recording, "voltage_V", "speed_rad_s")


def test_figures_of_a_lag():
    """Rise tau ln 9, settling tau ln 50 and tau ln 20."""
    found = step_figures(measured(recorded(lag(-3.0, 0.2))), expected=-35.0)
    assert found.gain == pytest.approx(-3.0, rel=1e-4)
    assert found.rise_s == pytest.approx(0.2 * math.log(9), abs=2e-3)
    assert found.settling_2_s == pytest.approx(0.2 * math.log(50), abs=3e-3)
    assert found.settling_5_s == pytest.approx(0.2 * math.log(20), abs=3e-3)
    assert found.overshoot_percent == 0.0
    assert found.steady_state_error == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize("zeta", [0.2, 0.4, 0.6])
def test_figures_are_controls(zeta):
    natural = 12.0
    found = step_figures(measured(recorded(pair(2.0, natural, zeta))))
    told = control.step_info(control.tf([natural**2], [1, 2 * zeta * natural, natural**2]), T=TIME[:3500])
    assert found.rise_s == pytest.approx(told["RiseTime"], abs=3e-3)
    assert found.settling_2_s == pytest.approx(told["SettlingTime"], abs=5e-3)
    assert found.overshoot_percent == pytest.approx(told["Overshoot"], rel=0.02)
    assert found.peak_s == pytest.approx(told["PeakTime"], abs=5e-3)


@pytest.mark.parametrize("delay", [0.0, 0.13])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_models_read_off_a_lag_with_delay(delay, noise):
    response = measured(recorded(lag(3.0, 0.2, delay), noise=noise))
    for read in (two_point, sundaresan):
        found = read(response)
        assert found["time_constant_s"] == pytest.approx(0.2, rel=0.04)
        assert found["delay_s"] == pytest.approx(delay, abs=0.01)
        assert found["gain"] == pytest.approx(3.0, rel=0.01)
    assert one_point(response)["time_constant_s"] == pytest.approx(0.2 + delay, rel=0.03)


@pytest.mark.parametrize("zeta", [0.2, 0.5])
def test_damping_read_off_the_overshoot(zeta):
    found = overshoot(measured(recorded(pair(2.0, 12.0, zeta), noise=0.05)))
    assert found["damping_ratio"] == pytest.approx(zeta, rel=0.05)
    assert found["natural_frequency_rad_s"] == pytest.approx(12.0, rel=0.05)


def test_a_response_without_overshoot_says_so():
    with pytest.raises(IdentifyError, match="no overshoot"):
        METHODS[-1].read(measured(recorded(lag(1.0, 0.2), noise=0.05)))


SINCE = np.clip(TIME - 0.5, 0.0, None)


@pytest.mark.parametrize(
    ("recording", "words"),
    [
        (recorded(lag(1.0, 0.2), np.full(len(TIME), 3.0)), "never comes: voltage_V is 3"),
        (recorded(lag(1.0, 0.2), np.sin(TIME)), "is no step"),
        (recorded(np.zeros(len(TIME)), noise=0.1), "does not answer"),
        (recorded(np.zeros(len(TIME))), "does not answer"),
        (recorded(lag(1.0, 5.0), noise=0.01), "never settles"),
        (recorded(4.0 * SINCE, noise=0.01), "never settles"),
        (recorded(pair(1.0, 12.0, 0.001), noise=0.01), "swings"),
        (recorded(lag(1.0, 0.2)[:505], STEP[:505]), "is no step: it stays for 5 rows"),
        (recorded(lag(1.0, 0.0005)), None),
    ],
)
def test_what_is_no_step_response_is_said(recording, words):
    if words is None:
        with pytest.raises(IdentifyError, match="ten times faster"):
            two_point(measured(recording))
        return
    with pytest.raises(IdentifyError, match=words) as caught:
        measured(recording)
    assert "\n" not in str(caught.value)


def test_a_few_rows_of_a_rise_are_no_settled_response() -> None:
    time = np.arange(30) * 0.005
    rise = 18.0 * (1.0 - np.exp(-np.clip(time - 0.1, 0.0, None) / 2.0)) + np.random.default_rng(1).normal(0, 0.05, 30)
    made = make_recording(time, {"u": np.where(time >= 0.1, 12.0, 0.0), "y": rise}, "short.csv", "")
    with pytest.raises(IdentifyError, match=r"short.csv: 10 rows after the step are too short to tell whether y has"):
        step_response(made, "u", "y")


def test_the_first_tenth_of_a_time_constant_is_no_settled_response() -> None:
    """Too few rows at the end to be certain of the drift, but twice as many say so, too."""
    time = np.arange(150) * 0.001
    missed = 0
    for seed in range(40):
        rise = 20.0 * (1.0 - np.exp(-np.clip(time - 0.1, 0.0, None) / 0.5))
        noisy = rise + np.random.default_rng(seed).normal(0, 0.05, 150)
        made = make_recording(time, {"u": np.where(time >= 0.1, 10.0, 0.0), "y": noisy}, "short.csv", "")
        try:
            step_response(made, "u", "y")
        except IdentifyError as error:
            assert "never settles" in str(error)
        else:
            missed += 1
    assert missed <= 4, missed


def test_noise_is_no_swing() -> None:
    time = np.arange(2000) * 0.001
    noisy = np.where(time >= 0.1, 20.0, 0.0) + np.random.default_rng(3).normal(0, 50.0, 2000)
    made = make_recording(time, {"u": np.where(time >= 0.1, 10.0, 0.0), "y": noisy}, "loud.csv", "")
    with pytest.raises(IdentifyError, match="or with less noise"):
        step_response(made, "u", "y")


def test_trials_by_students_t():
    """Three values: t_0.975(2) = 4.3027."""
    found = repeated([1.0, 2.0, 4.0])
    assert found.mean == pytest.approx(7 / 3)
    assert found.half == pytest.approx(4.302653 * np.std([1, 2, 4], ddof=1) / math.sqrt(3), rel=1e-6)
    with pytest.raises(IdentifyError, match="at least 3 trials"):
        repeated([1.0, 2.0])


def test_intervals_of_one_trial_hold_the_truth_as_often_as_they_say() -> None:
    """Of a lag with delay, which is the rule's own plant, recorded for nine time constants."""
    inside, repeats = np.zeros(3), 40
    time = np.arange(200) * 0.02
    clean = 3.0 * (1.0 - np.exp(-np.clip(time - 0.5, 0.0, None) / 0.36))
    for seed in range(repeats):
        noisy = clean + np.random.default_rng(seed).normal(0.0, 0.05, len(time))
        made = make_recording(time, {"u": np.where(time >= 0.2, 2.0, 0.0), "y": noisy}, "step", "")
        response = step_response(made, "u", "y")
        found = two_point(response)
        half = noise_halves(response, {"two": two_point}, 30)["two"]
        truth = {"gain": 1.5, "time_constant_s": 0.36, "delay_s": 0.3}
        inside += [abs(found[name] - true) <= half[name] for name, true in truth.items()]
    assert np.all(inside / repeats > 0.84), inside / repeats  # three deviations of 40 draws below 95 %


def test_a_rule_without_a_model_in_some_draw_has_no_interval() -> None:
    made = recorded(lag(1.5, 0.4), noise=0.01)
    halves = noise_halves(
        step_response(made, "voltage_V", "speed_rad_s"), {"overshoot": overshoot, "63 %": one_point}, 20
    )
    assert halves["overshoot"] == {} and halves["63 %"]["delay_s"] == 0.0 and halves["63 %"]["time_constant_s"] > 0.0
