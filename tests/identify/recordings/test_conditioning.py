"""Conditioning: same treatment for model and measurement, so that no parameter moves."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import (
    NONE,
    Conditioning,
    check_parts,
    compared_time,
    condition_output,
    conditioning_from_table,
    find_lag,
    interpolate,
    windows,
)
from firmloop.identify.recordings.recording import make_recording

EVERYTHING = Conditioning(
    remove_offset=("y",),
    detrend=("y",),
    savgol_window=31,
    savgol_order=2,
    resample_s=0.004,
    align=(),
    align_max_lag_s=0.0,
)


def lag_recording(noise: float, offset: float = 0.0, drift: float = 0.0, late: float = 0.0, seed: int = 0):
    """First-order lag of gain 2 and 30 ms, sampled every 5 ms; its output by the exact formula."""
    rng = np.random.default_rng(seed)
    rows, step = 1500, 0.005
    time = np.arange(rows) * step
    drive = np.repeat(rng.choice([-1.0, 0.0, 1.0], rows // 15), 15)
    output, decay = np.zeros(rows), np.exp(-step / 0.03)
    for k in range(rows - 1):
        output[k + 1] = decay * output[k] + (1.0 - decay) * 2.0 * drive[k]
    shown = interpolate(time, output, time - late) + offset + drift * time + noise * rng.normal(size=rows)
    return make_recording(time, {"u": drive, "y": shown}, f"lag {seed}", "")


def fitted(recording, conditioning: Conditioning, **parameters: object):
    return fit(
        make_plant("first_order", "u", ["y"], {"delay_s": {"value": 0.0, "free": False}, **parameters}),
        [recording],
        [],
        conditioning,
    )


def test_heavy_smoothing_does_not_move_a_noiseless_fit() -> None:
    for conditioning in (NONE, EVERYTHING, Conditioning(savgol_window=101)):
        by_name = {p.name: p.value for p in fitted(lag_recording(0.0), conditioning).plant.parameters}
        assert by_name["time_constant_s"] == pytest.approx(0.03, rel=1e-6)
        assert by_name["gain"] == pytest.approx(2.0, rel=1e-6)


def test_smoothing_the_measurement_alone_would_have_moved_it() -> None:
    raw = lag_recording(0.0)
    smooth = scipy.signal.savgol_filter(raw.columns["y"], 101, 2)
    half = make_recording(raw.time, {"u": raw.columns["u"], "y": smooth}, "smoothed", "")
    by_name = {p.name: p.value for p in fitted(half, NONE).plant.parameters}
    assert abs(by_name["time_constant_s"] / 0.03 - 1.0) > 0.05


def test_offset_and_drift_are_taken_out_where_asked() -> None:
    recording = lag_recording(0.02, offset=5.0, drift=0.3)
    conditioning = Conditioning(remove_offset=("y",), detrend=("y",))
    by_name = {p.name: p for p in fitted(recording, conditioning).plant.parameters}
    low, high = by_name["gain"].interval_95
    assert low < 2.0 < high
    assert high - low < 0.05
    with pytest.raises(IdentifyError, match=r"the output drifts .* detrend"):
        fitted(recording, NONE)


def test_input_offset_is_removed_from_the_input_itself() -> None:
    raw = lag_recording(0.0)
    shifted = make_recording(raw.time, {"u": raw.columns["u"] + 7.0, "y": raw.columns["y"]}, "shifted", "")
    result = fitted(shifted, Conditioning(remove_offset=("u", "y")))
    assert {p.name: p.value for p in result.plant.parameters}["gain"] == pytest.approx(2.0, rel=1e-4)


def test_clock_difference_is_found_and_taken_out() -> None:
    recording = lag_recording(0.01, late=0.042)
    result = fitted(recording, Conditioning(align=("y",), align_max_lag_s=0.1))
    assert result.train[0].lags["y"] == pytest.approx(0.042, abs=0.004)
    assert {p.name: p.value for p in result.plant.parameters}["time_constant_s"] == pytest.approx(0.03, rel=0.15)
    assert result.train[0].scores["y"].fit_percent > fitted(recording, NONE).train[0].scores["y"].fit_percent + 10.0


@pytest.mark.parametrize("late", [-0.013, 0.0, 0.0205])
def test_lag_is_found_between_rows(late: float) -> None:
    time = np.arange(2000) * 1e-3
    signal = np.cumsum(np.random.default_rng(1).normal(size=2000))
    shown = interpolate(time, signal, time - late)
    assert find_lag(time, shown, signal, 0.05) == pytest.approx(late, abs=3e-4)
    assert find_lag(time, np.ones(2000), signal, 0.05) == 0.0


def test_conditioning_is_linear() -> None:
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(1e-3, 1.4e-3, 300))
    a, b = rng.normal(size=(300, 2)), rng.normal(size=(300, 2))
    mixed = condition_output(EVERYTHING, "y", time, 2.0 * a - 3.0 * b)
    apart = 2.0 * condition_output(EVERYTHING, "y", time, a) - 3.0 * condition_output(EVERYTHING, "y", time, b)
    np.testing.assert_allclose(mixed, apart, atol=1e-12)
    assert len(mixed) == len(compared_time(EVERYTHING, time))
    np.testing.assert_allclose(mixed.mean(axis=0), 0.0, atol=1e-12)


def test_table_becomes_conditioning() -> None:
    table = {"remove_offset": ["y"], "savgol_window": 11, "resample_s": 0.01, "align": ["y"], "align_max_lag_s": 0.1}
    made = conditioning_from_table(table)
    assert made == Conditioning(("y",), (), 11, 2, 0.01, ("y",), 0.1)
    assert conditioning_from_table({}) == NONE


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"savgol": 5}, "savgol is unknown"),
        ({"remove_offset": "y"}, "list of signal names"),
        ({"detrend": [1]}, "list of signal names"),
        ({"savgol_window": 10}, "must be odd"),
        ({"savgol_window": 3, "savgol_order": 3}, "larger than savgol_order"),
        ({"savgol_window": 5.0}, "whole number"),
        ({"resample_s": 0}, "positive number"),
        ({"resample_s": True}, "positive number"),
        ({"align": ["y"]}, "align_max_lag_s"),
    ],
)
def test_wrong_table_is_refused_by_key(table: dict[str, object], words: str) -> None:
    with pytest.raises(IdentifyError, match=r"recordings\.conditioning") as refused:
        conditioning_from_table(table)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("conditioning", "words"),
    [
        (Conditioning(detrend=("z",)), "z is no signal of the plant, which has u, y"),
        (Conditioning(resample_s=100.0), "1 rows to compare"),
        (Conditioning(savgol_window=4001), "1500 rows to compare"),
    ],
)
def test_conditioning_that_does_not_fit_is_refused(conditioning: Conditioning, words: str) -> None:
    with pytest.raises(IdentifyError) as refused:
        fitted(lag_recording(0.0), conditioning)
    assert words in str(refused.value)


def test_smoothing_uneven_rows_asks_for_resampling() -> None:
    raw = lag_recording(0.0)
    time = raw.time + np.where(np.arange(1500) % 2, 0.002, 0.0)
    recording = make_recording(time, dict(raw.columns), "uneven", "")
    with pytest.raises(IdentifyError, match="add resample_s"):
        fitted(recording, Conditioning(savgol_window=11))


def test_an_aligned_clock_moves_no_parameter_and_widens_its_interval() -> None:
    """Clocks that agree: in turns, a lag of a third of a row would be left, and be taken out of the time constant."""
    time = np.arange(1000) * 2e-3
    drive = np.where(time >= 0.1, 10.0, 0.0)
    clean = np.where(time >= 0.1, 20.0 * (1.0 - np.exp(-np.clip(time - 0.1, 0.0, None) / 0.2)), 0.0)
    fixed = {"value": 0.0, "free": False}
    plant = make_plant("first_order", "u", ["y"], {"gain": 1.0, "time_constant_s": 0.1, "delay_s": fixed})
    off, known, lags = [], [], []
    for seed in range(6):
        noisy = clean + np.random.default_rng(seed).normal(0.0, 0.2, len(time))
        made = make_recording(time, {"u": drive, "y": noisy}, "", "")
        found = fit(plant, [made], [], Conditioning(align=("y",), align_max_lag_s=0.01))
        lag = found.plant.parameters[1]
        assert lag.deviation is not None
        off.append((lag.value - 0.2) / lag.deviation)
        lags.append(found.train[0].lags["y"])
        alone = fit(plant, [made], [], NONE).plant.parameters[1]
        known.append(lag.deviation / (alone.deviation or np.inf))
    assert abs(np.mean(off)) < 0.9 and np.max(np.abs(off)) < 2.5, off
    assert abs(np.mean(lags)) < 4e-4, lags
    assert np.min(known) > 1.1


@pytest.mark.parametrize(("key", "most"), [("resample_s", "100,000"), ("window_s", "1,000,000")])
def test_a_grid_beyond_all_measure_is_refused(key: str, most: str) -> None:
    with pytest.raises(IdentifyError, match=rf"{key} is 1e-12: .* 50 rows of r.csv .* at most {most}"):
        check_parts(Conditioning(**{key: 1e-12}), "r.csv", np.linspace(0.0, 1.0, 50))


@pytest.mark.parametrize("length", [1e-6, 1e-12, 1e-300])
def test_no_window_is_shorter_than_a_row_and_none_takes_memory(length: float) -> None:
    time = np.linspace(0.0, 200.0, 201)
    assert windows(Conditioning(window_s=length), time, 4) == windows(Conditioning(window_s=1.0), time, 4)


@pytest.mark.parametrize("key", ["savgol_window", "savgol_order", "line_harmonics"])
def test_a_size_beyond_all_measure_is_refused(key: str) -> None:
    with pytest.raises(IdentifyError, match=f"{key} is 1000000001; .* at most"):
        conditioning_from_table({key: 1_000_000_001})
