"""What an input does between its rows, and time stamps that were rounded when they were printed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case, write_case
from firmloop.diagnose.data.intersample import believed_hold
from firmloop.diagnose.data.prepare import shortened
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.hold import knots
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of

_STEP = 1e-3
_STAGE = {"mass_kg": 0.5, "b_N_s_m": 40.0}


def _sines(time):
    waves = ((17.0, 1.0), (90.0, 0.7), (210.0, 0.5))  # Hz, all far below half the sampling rate
    return sum(size * np.sin(2.0 * np.pi * wave * time + wave) for wave, size in waves)


def _recording(rows, finer, hold):
    """Record a stage whose force is a smooth curve: simulated on a grid `finer` times as dense, read at its rows."""
    time = np.arange(rows * finer) * _STEP / finer
    dense = make_recording(time, {"force_N": _sines(time), "speed_m_s": 0.0 * time}, "dense", "")
    plant = make_plant("linear_stage", "force_N", ["speed_m_s"], _STAGE)
    speed = simulate(plant, replace(dense, hold="linear"), None)[:, 0]
    columns = {"force_N": _sines(time)[::finer], "speed_m_s": speed[::finer]}
    return plant, replace(make_recording(time[::finer], columns, "smooth", ""), hold=hold)


@pytest.mark.parametrize(("hold", "within"), [("zero_order", np.inf), ("linear", 3e-2), ("band_limited", 2e-3)])
def test_a_band_limited_input_is_followed_between_its_rows(hold, within):
    plant, recording = _recording(2000, 32, hold)
    left = recording.columns["speed_m_s"] - simulate(plant, recording, None)[:, 0]
    size = np.std(recording.columns["speed_m_s"])
    assert np.std(left[200:-200]) < within * size
    if hold == "zero_order":
        assert np.std(left[200:-200]) > 0.05 * size  # half a row of 1 ms late, at 17 Hz and above


def test_what_the_input_did_is_found_in_the_recording_alone():
    plant, recording = _recording(2000, 32, "zero_order")
    rng = np.random.default_rng(1)
    noisy = recording.columns["speed_m_s"] + 1e-4 * rng.standard_normal(2000)
    columns = {"force_N": recording.columns["force_N"], "speed_m_s": noisy}
    assert believed_hold(plant, [make_recording(recording.time, columns, "smooth", "")]) == "band_limited"
    held = simulate(plant, recording, None)[:, 0] + 1e-4 * rng.standard_normal(2000)
    columns = {"force_N": recording.columns["force_N"], "speed_m_s": held}
    assert believed_hold(plant, [make_recording(recording.time, columns, "held", "")]) == "zero_order"


def test_a_clock_that_drifts_is_no_other_hold(tmp_path):
    write_case(draw_case(360071), tmp_path / "case", tmp_path / "labels")
    project = read_project(tmp_path / "case" / "project.toml")
    assert believed_hold(plant_of(project), read_data(project).train) == "zero_order"


def test_a_band_limited_input_needs_even_rows():
    time = np.array([0.0, 0.1, 0.25, 0.3, 0.4])
    with pytest.raises(IdentifyError, match=r"band_limited.*resample"):
        knots("band_limited", time, np.ones((5, 1)), "odd.csv")


def test_rounded_stamps_are_even_again_and_jitter_stays():
    true = 100.0 + 1.6384e-3 * np.arange(5000)
    printed = np.array([float(f"{t:.7g}") for t in true])
    assert np.ptp(np.diff(printed)) > 5e-5
    assert np.ptp(np.diff(evened(printed))) < 1e-12
    assert np.max(np.abs(evened(printed) - true)) < 1e-4
    jittered = true + 1e-4 * np.random.default_rng(2).standard_normal(5000)
    assert evened(jittered) is jittered


@pytest.mark.parametrize(("step", "places"), [(1.0 / 30.0, 2), (1.0 / 60.0, 4), (5.0 / 60.0, 4)])
def test_stamps_with_few_digits_behind_the_point_are_even_and_a_row_that_is_missing_stays_so(
    step: float, places: int
) -> None:
    true = step * np.arange(300)
    printed = np.round(true, places)
    assert np.ptp(np.diff(evened(printed))) < 1e-12 and np.max(np.abs(evened(printed) - true)) < 10.0**-places
    missing = np.delete(printed, 150)
    assert evened(missing) is missing


def test_long_recordings_are_cut_in_proportion():
    plant, recording = _recording(2000, 1, "zero_order")
    parts = shortened(plant, [recording, recording], 1000)
    assert [len(part.time) for part in parts] == [500, 500]
    assert shortened(plant, [recording], 5000) == (recording,)


def test_a_lag_that_moves_takes_drag_and_a_temperature_does_not():
    table = {"kind": "first_order", "input": "command", "outputs": ["tacho_V"]}
    values = {"parameters": {"gain": 10.0, "time_constant_s": 0.5, "delay_s": 0.0}}
    drag = {"effects": [{"name": "quadratic_drag", "coefficient_N_m_s2_rad2": 0.1}]}
    plant = plant_from_table({**table, **values, **drag})
    time = np.arange(200) * 0.05
    steps = make_recording(time, {"command": np.ones(200), "tacho_V": 0.0 * time}, "step", "")
    # At rest 10 = y + 0.1 y^2.
    assert simulate(plant, steps, None)[-1, 0] == pytest.approx(0.5 * (np.sqrt(500.0) - 10.0), rel=1e-4)
    with pytest.raises(IdentifyError, match="needs a torque"):
        plant_from_table({**table, "outputs": ["temperature_C"], **values, **drag})


def test_an_effort_may_be_bent_where_the_equations_are():
    pull = "k_N_m*max(-1, min(1, target_rad - position_rad))"
    table = {
        "kind": "ode",
        "states": ["position_rad", "speed_rad_s"],
        "inputs": ["target_rad"],
        "outputs": {"position_rad": "position_rad"},
        "derivatives": {"position_rad": "speed_rad_s", "speed_rad_s": f"({pull} - 0.5*speed_rad_s) / 0.01"},
        "balances": {"speed_rad_s": {"kind": "torque", "per": "1/0.01", "position": "position_rad", "effort": pull}},
        "parameters": {"k_N_m": 2.0},
    }
    time = np.arange(2000) * 0.002
    steps = make_recording(time, {"target_rad": np.full(2000, 3.0), "position_rad": 0.0 * time}, "step", "")
    free = simulate(plant_from_table(table), steps, None)[:, 0]
    rubbed = plant_from_table({**table, "effects": [{"name": "load_dependent_friction", "ratio": 0.25}]})
    held = simulate(rubbed, steps, None)[:, 0]
    # While the pull is at its limit, the friction takes a quarter of it: the speed is three quarters.
    rows = slice(100, 200)
    assert np.polyfit(time[rows], held[rows], 1)[0] == pytest.approx(
        0.75 * np.polyfit(time[rows], free[rows], 1)[0], rel=1e-3
    )


@pytest.mark.parametrize("rate", [40.0, 150.0, 400.0, 1e13])
def test_an_actuator_with_a_limited_slope_follows_an_input_that_moves_between_its_rows(rate):
    plant, recording = _recording(150, 1, "linear")
    limited = with_effects(plant, [EffectUse("slew_rate_limit", None, {"rate_N_s": rate}, ())])
    fine = np.linspace(0.0, recording.time[-1], 1024 * (len(recording.time) - 1) + 1)
    wanted = np.interp(fine, recording.time, recording.columns["force_N"])
    followed = np.zeros(len(fine))
    for k in range(1, len(fine)):
        most = rate * (fine[k] - fine[k - 1])
        followed[k] = followed[k - 1] + np.clip(wanted[k] - followed[k - 1], -most, most)
    dense = make_recording(fine, {"force_N": followed, "speed_m_s": 0.0 * fine}, "dense", "")
    expected = simulate(plant, replace(dense, hold="linear"), None)[::1024, 0]
    speed = simulate(limited, recording, None)[:, 0]
    assert np.max(np.abs(speed - expected)) < 1e-3 * np.std(expected)
    free = simulate(plant, recording, None)[:, 0]
    assert (rate < 1e3) == (np.max(np.abs(speed - free)) > 1e-2 * np.std(free))
