"""What is cut off, and what only rests."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.identify.recordings.clipping import cut_off, gathering, holds_elsewhere, in_steps, rested

TIME = np.arange(400) * 5e-3
NOISE = np.random.default_rng(5).normal(0.0, 0.02, len(TIME))
WAVE = 10.0 * np.sin(2 * np.pi * TIME)


def lag(constant: float) -> np.ndarray:
    return np.asarray(8.0 * (1.0 - np.exp(-np.clip(TIME - 0.1, 0.0, None) / constant)))


@pytest.mark.parametrize("resolution", [0.0, 1e-4, 0.02, 0.05])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_wave_that_is_cut_off(resolution: float, noise: float) -> None:
    whole = WAVE + noise * NOISE
    cut = np.minimum(whole, 7.0)
    read = np.round(cut / resolution) * resolution if resolution else cut
    found = cut_off(read)
    assert found is not None and found.value == pytest.approx(7.0)
    assert found.share == pytest.approx(np.mean(read == read.max()), abs=0.02)
    assert cut_off(-read) is not None
    assert cut_off(np.round(whole / resolution) * resolution if resolution else whole) is None


@pytest.mark.parametrize("resolution", [0.0, 1e-4, 0.05, 0.5])
@pytest.mark.parametrize("constant", [1e-4, 2e-3, 5e-3, 0.02, 0.1, 1.0])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_response_that_settles_is_not(resolution: float, constant: float, noise: float) -> None:
    whole = lag(constant) + noise * NOISE
    read = np.round(whole / resolution) * resolution if resolution else whole
    assert cut_off(read) is None and cut_off(-read) is None


def test_steps_and_rest_are_not() -> None:
    assert cut_off(np.where(TIME > 0.5, 12.0, 0.0)) is None
    assert cut_off(np.zeros(100)) is None
    assert cut_off(np.maximum(WAVE, 0.0)) is None, "zero may be rest"


def test_the_highest_step_of_several_is_no_limit() -> None:
    ramped = np.interp(np.arange(200.0), [0, 20, 50, 60, 90, 110, 140, 150, 200], [0, 4, 4, 7, 7, 9, 9, 5, 5])
    ramped[1] = 0.01  # what it resolves
    limited = np.minimum(9.0 + WAVE, 9.4)
    assert cut_off(ramped) is not None and in_steps(ramped, 9.0)
    assert cut_off(limited) is not None and not in_steps(limited, 9.4)


def test_a_place_that_was_held_no_longer_than_others_is_no_limit() -> None:
    moved = np.interp(np.arange(400.0), [0, 20, 50, 110, 130, 150, 170, 230, 260, 399], [0, 0, 5, 5, 9, 9, 4, 4, 2, 0])
    stopped = np.interp(np.arange(400.0), [0, 20, 50, 60, 80, 250, 270, 280, 300, 399], [0, 0, 5, 5, 9, 9, 4, 4, 2, 0])
    for each, held in ((moved, True), (stopped, False), (-moved, True), (-stopped, False)):
        found = cut_off(each)
        assert found is not None and holds_elsewhere(each, found.value) == held


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.3])
def test_readings_gather_at_a_limit_behind_which_the_noise_is(noise: float) -> None:
    disturbance = noise / 0.02 * NOISE
    for low in (-7.0, 0.0):
        found = gathering([np.clip(WAVE, low, 7.0) + disturbance])
        assert found is not None and found.level == pytest.approx(7.0, rel=0.01)
    assert gathering([WAVE + disturbance]) is None


@pytest.mark.parametrize("resolution", [0.0, 0.01, 0.5])
def test_a_limit_is_not_below_where_readings_rest(resolution: float) -> None:
    cut = np.clip(WAVE, -7.0, 7.0)
    read = np.round(cut / resolution) * resolution if resolution else cut
    low = rested([read])
    assert 6.0 < low <= 7.0
    assert rested([np.clip(WAVE, -7.0, 7.0) + 0.01 * NOISE]) == 0.0, "noise is behind this limit"
