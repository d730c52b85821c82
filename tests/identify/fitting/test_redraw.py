"""Intervals by Monte Carlo and bootstrap, residual tests and sensitivities say what is true."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from firmloop.identify.bench_tests.sensitivity import sensitivity
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.fitting.redraw import CHECKED, blocks, left_over, redraw, white
from firmloop.identify.fitting.residual_tests import residual_tests
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE, Conditioning, conditioning_from_table
from firmloop.identify.recordings.recording import make_recording

TIME = np.arange(300) * 2e-3
STEP = np.where(TIME >= 0.02, 10.0, 0.0)
FIXED = {"value": 0.0, "free": False}


def plant(kind: str = "first_order"):
    if kind == "first_order":
        return make_plant(kind, "voltage_V", ["speed_rad_s"], {"gain": 2.0, "time_constant_s": 0.1, "delay_s": FIXED})
    values = {"gain": 2.0, "natural_frequency_rad_s": 30.0, "damping_ratio": 0.4, "delay_s": FIXED}
    return make_plant(kind, "voltage_V", ["speed_rad_s"], values)


def recorded(noise: np.ndarray):
    since = np.clip(TIME - 0.02, 0.0, None)
    return make_recording(
        TIME, {"voltage_V": STEP, "speed_rad_s": 20.0 * (1 - np.exp(-since / 0.1)) + noise}, "run.csv", ""
    )


def quiet(share: float, doing: str) -> None:
    pass


def test_three_intervals_agree_on_white_noise():
    recording = recorded(np.random.default_rng(2).normal(0, 0.3, len(TIME)))
    found = fit(plant(), [recording], [], NONE)
    for drawn in (redraw(found, [recording], NONE, how, 600, 1, quiet) for how in (white, blocks)):
        assert drawn.failed == 0 and drawn.draws.shape == (600, 2)
        for parameter in found.plant.parameters[:2]:
            ends, expected = np.array(drawn.interval_95(parameter.name)), np.array(parameter.interval_95)
            width = expected[1] - expected[0]
            assert ends == pytest.approx(expected, abs=0.15 * width)


def test_the_bootstrap_sees_that_noise_is_coloured_and_white_draws_do_not():
    """Noise with a memory of 10 rows hides the gain more than white noise of the same size."""
    random = np.random.default_rng(3)
    noise = scipy.signal.lfilter([0.1], [1, -0.9], random.normal(0, 3.0, len(TIME) + 200))[200:]
    recording = recorded(noise)
    found = fit(plant(), [recording], [], NONE)
    naive, honest = (redraw(found, [recording], NONE, how, 300, 1, quiet).draws[:, 0].std() for how in (white, blocks))
    assert honest > 1.5 * naive


@pytest.mark.parametrize("size", [0.5, 8.0])
def test_a_refit_is_a_whole_fit(size: float):
    """Gauss-Newton on drawn data ends where identify ends on the same data, also where no expansion holds."""
    recording = recorded(np.random.default_rng(4).normal(0, size, len(TIME)))
    found = fit(plant(), [recording], [], NONE)
    kept: list[np.ndarray] = []

    def keep(residual: np.ndarray, random: np.random.Generator) -> np.ndarray:
        kept.append(random.normal(0, size, residual.shape))
        return kept[-1]

    drawn = redraw(found, [recording], NONE, keep, 20, 1, quiet)
    simulated = found.train[0].simulated
    assert (len(kept) == 20 + CHECKED) == (size < 1.0), "whole simulations are those that are checked, or all"
    for noise, again in zip(kept[:20], drawn.draws, strict=True):
        columns = {"voltage_V": STEP, "speed_rad_s": (simulated + noise)[:, 0]}
        told = fit(plant(), [make_recording(TIME, columns, "again", "")], [], NONE)
        deviation = np.array([p.deviation for p in told.plant.parameters[:2]])
        assert again == pytest.approx([p.value for p in told.plant.parameters[:2]], abs=0.01 * deviation.max())


def test_line_harmonics_are_taken_out_of_both_sides():
    random = np.random.default_rng(5)
    hum = 1.5 * np.sin(2 * np.pi * 50 * TIME + 0.3) + 0.7 * np.cos(2 * np.pi * 150 * TIME)
    recording = recorded(hum + random.normal(0, 0.1, len(TIME)))
    filtered = conditioning_from_table({"line_Hz": 50.0})
    bare, found = (fit(plant(), [recording], [], how) for how in (NONE, filtered))
    assert found.noise["speed_rad_s"] < 0.12 < 0.9 < bare.noise["speed_rad_s"]
    low, high = found.plant.parameters[1].interval_95
    assert low < 0.1 < high
    ((left, drive),) = left_over(found, [recording], filtered)
    tests = residual_tests(left[:, 0], drive[:, 0])
    assert tests.white and tests.independent
    with pytest.raises(IdentifyError, match=r"line_Hz is 300.*shows up to 250 Hz"):
        fit(plant(), [recording], [], Conditioning(line_Hz=300.0))
    with pytest.raises(IdentifyError, match=r"holds 1\.2 cycles"):
        fit(plant(), [recording], [], Conditioning(line_Hz=2.0))


def test_residual_tests_fail_5_percent_of_right_models():
    random = np.random.default_rng(6)
    drive = np.repeat(random.choice([-1.0, 1.0], 60), 10)
    found = [residual_tests(random.normal(0, 1, 600), drive) for _ in range(400)]
    for share in (
        np.mean([not test.white for test in found]),
        np.mean([not test.independent for test in found]),
        np.mean([test.bias < 0.05 for test in found]),
    ):
        assert 0.02 < share < 0.09


@pytest.mark.parametrize("pole", [0.6, 0.9])
def test_the_colour_of_a_residual_is_no_sign_of_the_input_or_of_a_mean(pole: float):
    """Coloured residuals beside a slow input: taken for white ones, one right model in three would fail."""
    random = np.random.default_rng(8)
    found = []
    for _ in range(200):
        noise, drive = (scipy.signal.lfilter([1], [1, -pole], random.normal(0, 1, 3000))[1000:] for _ in range(2))
        found.append(residual_tests(noise, drive))
    assert np.mean([not test.independent for test in found]) < 0.1
    assert np.mean([test.bias < 0.05 for test in found]) < 0.12


def test_residual_tests_find_what_is_left():
    random = np.random.default_rng(7)
    drive = np.repeat(random.choice([-1.0, 1.0], 60), 10)
    noise = random.normal(0, 1, 600)
    left = residual_tests(noise + 0.5 * np.concatenate([np.zeros(7), drive[:-7]]), drive)
    assert not left.independent and abs(left.worst_lag - 7) <= 3
    assert not residual_tests(scipy.signal.lfilter([1], [1, -0.5], noise), drive).white
    assert residual_tests(noise + 0.3, drive).bias < 0.001


def test_sensitivities_of_a_lag_are_known():
    """Gain moves the final value alone, the time constant the times alone, both in proportion."""
    found = sensitivity(plant(), 10.0, 1)
    assert found.local["final"]["gain"] == pytest.approx(1.0, abs=0.01)
    assert found.local["rise_s"]["time_constant_s"] == pytest.approx(1.0, abs=0.02)
    assert found.local["settling_2_s"]["time_constant_s"] == pytest.approx(1.0, abs=0.02)
    assert found.local["rise_s"]["gain"] == pytest.approx(0.0, abs=0.01)
    assert found.first["final"]["gain"] == pytest.approx(1.0, abs=0.05)
    assert found.total["rise_s"]["gain"] == pytest.approx(0.0, abs=0.05)


def test_overshoot_belongs_to_the_damping():
    found = sensitivity(plant("second_order"), 10.0, 1)
    assert found.local["overshoot_percent"]["damping_ratio"] < -0.3
    assert found.total["overshoot_percent"]["damping_ratio"] > 0.95
    assert found.total["overshoot_percent"]["natural_frequency_rad_s"] < 0.05
