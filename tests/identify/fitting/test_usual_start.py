"""What moves by itself begins where its readings say; the checks of a free swing do not simulate it for hours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from firmloop.identify.fitting.checks import clock_unit, drift
from firmloop.identify.fitting.evidence import Evidence, Explanation
from firmloop.identify.fitting.experiment import experiments
from firmloop.identify.fitting.fit import fit
from firmloop.identify.fitting.own_values import fit_start, usual_start
from firmloop.identify.fitting.problem import bounded, make_problem
from firmloop.identify.fitting.stretches import stretches
from firmloop.identify.plants.attach import EffectUse, with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.ode import make_ode
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import constants_of, simulate, simulator

PENDULUM = make_ode(
    {
        "kind": "ode",
        "states": ["theta", "rate"],
        "inputs": ["torque_N_m"],
        "outputs": {"swing_rad": "theta"},
        "derivatives": {"theta": "rate", "rate": "(torque_N_m - 0.3*sin(theta) - b_N_m_s_rad*rate)/0.01"},
        "parameters": {"b_N_m_s_rad": 3e-4},
    }
)


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Where the recordings end (s) on the clocks that are tried, none of which explains anything."""
    ends: list[float] = []

    def share(evidence: Evidence, recording: Recording) -> list[float]:
        ends.append(float(recording.time[-1]))
        return [1.0]

    monkeypatch.setattr(clock_unit, "unexplained", share)
    return ends


def swinging(drive: float) -> Recording:
    """Return ten seconds of a swing from 1.2 rad at -2 rad/s, with a drive at one moment."""
    time = np.arange(0.0, 10.0, 0.01)
    torque = np.where(np.isclose(time, 5.0), drive, 0.0)
    blank = make_recording(time, {"torque_N_m": torque, "swing_rad": np.zeros_like(time)}, "swing.csv", "")
    moved = simulate(PENDULUM, blank, np.array([1.2, -2.0]))[:, 0]
    return make_recording(time, {"torque_N_m": torque, "swing_rad": moved}, "swing.csv", "")


def test_a_free_swing_begins_as_its_readings_do_whatever_its_states_are_called() -> None:
    assert usual_start(PENDULUM, swinging(0.0)) == pytest.approx([1.2, -2.0], abs=1.5)
    assert np.all(usual_start(PENDULUM, swinging(0.1)) == 0.0)


def test_a_swing_of_two_minutes_is_met_from_where_it_begins_swing_by_swing() -> None:
    """Its readings lead off by a third of a speed as it begins, and each swing later by more."""
    time = np.arange(0.0, 110.0, 0.02)
    still = {"torque_N_m": 0.0 * time, "swing_rad": 0.0 * time}
    moved = simulate(PENDULUM, make_recording(time, still, "swing.csv", ""), np.array([-0.49, 4.8]))[:, 0]
    readings = moved + 4e-4 * np.random.default_rng(2).normal(size=len(time))
    recording = make_recording(time, {**still, "swing_rad": readings}, "swing.csv", "")
    start = fit_start(PENDULUM, recording, constants_of(PENDULUM), NONE)
    assert start == pytest.approx([-0.49, 4.8], abs=1e-3)


def test_what_moves_by_itself_begins_as_it_reads_behind_a_sensor_that_lags() -> None:
    """A state of the sensor is none of the plant's; a lag under a constant input ended in an index error."""
    values = {"gain": 500.0, "time_constant_s": 0.1, "delay_s": 0.0}
    lag = [EffectUse("sensor_lag", None, {"time_constant_s": 0.07})]
    plant = with_effects(make_plant("first_order", "voltage_V", ["speed_rad_s"], values), lag)
    time = np.arange(0.0, 3.0, 0.05)
    columns = {"voltage_V": np.full(60, 3.0), "speed_rad_s": 1500.0 - 1380.0 * np.exp(-10.0 * time)}
    recording = make_recording(time, columns, "run.csv", "")
    assert usual_start(plant, recording) == pytest.approx([120.0])


def test_a_clock_on_which_all_is_over_before_the_next_row_is_not_simulated(tried: list[float]) -> None:
    """Of a stage of 0.07 s and rows 10 ms apart."""
    values = {"J_kg_m2": 7e-5, "b_N_m_s_rad": 1e-3, "torque_per_unit": 0.02}
    stage = make_plant("rotary_stage", "voltage_V", ["speed_rad_s"], values)
    time = np.arange(0.0, 1.0, 0.01)
    recording = make_recording(time, {"voltage_V": np.ones(100), "speed_rad_s": time}, "run.csv", "")
    clock_unit.look(Evidence(stage, (recording,), NONE, None))
    assert tried == pytest.approx([0.99, 0.99e-3, 0.99e-6])


def test_a_search_does_not_follow_a_plant_that_is_stiff_beyond_what_is_given() -> None:
    """Where a drag is no straight line, each row takes as many steps as the plant is quicker than it."""
    values = {"J_kg_m2": 7e-5, "b_N_m_s_rad": 1e-3, "torque_per_unit": 0.02}
    drag = [EffectUse("quadratic_drag", None, {"coefficient_N_m_s2_rad2": 1e-5})]
    stage = with_effects(make_plant("rotary_stage", "voltage_V", ["speed_rad_s"], values), drag)
    time = np.arange(0.0, 1.0, 0.01)
    recording = make_recording(time, {"voltage_V": np.sin(9.0 * time), "speed_rad_s": time}, "run.csv", "")
    parts, engine = experiments(stage, recording, NONE), simulator(stage, recording.hold)
    (made,) = bounded(make_problem(stage, engine, [parts]))[0].experiments
    constants, still = constants_of(stage), np.zeros(engine.states)
    assert np.all(np.isfinite(engine.run(made.course, constants, still)))
    stiff = constants * [1e-6, 1.0, 1.0, 1.0]
    assert np.isnan(engine.run(made.course, stiff, still)[-1, 0])
    assert np.all(np.isfinite(engine.run(parts[0].course, stiff * [1e2, 1.0, 1.0, 1.0], still)))


def test_a_start_is_tried_on_stretches_where_each_row_takes_many_steps() -> None:
    """As a long recording is; a stretch has a thousand rows, however many steps."""
    long = np.arange(0.0, 50.0, 0.01)
    moved = {"torque_N_m": np.zeros_like(long), "swing_rad": long * np.sin(7.0 * long)}
    (made,) = experiments(PENDULUM, make_recording(long, moved, "swing.csv", ""), NONE)
    assert stretches([made], [1e5]) == (made,)
    pieces = stretches([made], [1e6])
    assert [len(piece.measured) for piece in pieces] == [1000]
    assert pieces[0].course.first == 4000  # where it moves most


def test_a_clock_on_which_rows_would_miss_whole_swings_is_not_simulated(tried: list[float]) -> None:
    evidence = Evidence(PENDULUM, (swinging(0.0),), NONE, None)
    assert clock_unit.look(evidence) == ()
    assert max(tried) == pytest.approx(9.99)  # rows 0.6 s apart hide half a swing of 1.15 s and more


def test_a_clock_that_the_plant_follows_is_not_said_to_be_another() -> None:
    """A pot that loses less than is given sums up its heat, as it would on any quick clock, only better."""
    table = {
        "kind": "ode",
        "states": ["above_K"],
        "inputs": ["heater_on"],
        "outputs": {"above_K": "above_K"},
        "derivatives": {"above_K": "(power_W*heater_on - h_W_K*above_K)/84000.0"},
        "parameters": {"power_W": 1800.0, "h_W_K": 5.0},
    }
    given, time = make_ode(table), np.arange(0.0, 2500.0, 5.0)
    columns = {"heater_on": 1.0 * (np.arange(500) % 50 > 20), "above_K": np.zeros(500)}
    pot = make_ode({**table, "parameters": {"power_W": 1800.0, "h_W_K": 0.0}})
    columns["above_K"] = simulate(pot, make_recording(time, columns, "bare.csv", ""), None)[:, 0]
    recording = make_recording(time, columns, "pot.csv", "")
    assert clock_unit.look(Evidence(given, (recording,), NONE, None)) == ()
    assert "microseconds" in clock_unit.look(Evidence(given, (replace(recording, time=1e6 * time),), NONE, None))[0]


@pytest.mark.parametrize(("turns", "told"), [(0.5, True), (3.0, False)])
def test_a_line_beyond_all_that_moves_is_no_drift(turns: float, told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every window begins anew, next to nothing of a line is left to be seen, and its slope is any number."""
    free = {"J_kg_m2": {"value": 7e-5, "free": True}, "b_N_m_s_rad": {"value": 1e-3, "free": True}}
    stage = make_plant("rotary_stage", "torque_N_m", ["position_rad"], free)
    time = np.arange(0.0, 4.0, 0.01)
    columns = {"torque_N_m": np.sin(9.0 * time), "position_rad": np.zeros_like(time)}
    columns["position_rad"] = simulate(stage, make_recording(time, columns, "bare.csv", ""), None)[:, 0] + 0.1 * time
    recording = make_recording(time, columns, "run.csv", "")
    windows = replace(NONE, window_s=1.0)
    evidence = Evidence(stage, (recording,), windows, fit(stage, [recording], (), windows))
    slope = turns * float(np.ptp(columns["position_rad"])) / 4.0
    monkeypatch.setattr(drift, "explained", lambda *_: Explanation(0.9, slope, np.zeros(3)))
    said = drift.look(evidence)
    assert bool(said) == told and all("drifts by" in each for each in said)
