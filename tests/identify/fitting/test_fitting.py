"""Fitting: known parameters come back within their intervals, and what cannot be known is said."""

from __future__ import annotations

import math
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import Fit, fit
from firmloop.identify.fitting.own_values import fit_start
from firmloop.identify.fitting.scores import scores
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE, Conditioning
from firmloop.identify.recordings.recording import make_recording, read_recording
from firmloop.identify.simulation.simulate import constants_of, course_of, simulator

TRUE = {"R_ohm": 8.0, "L_H": 2e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 4e-6}


def nameplate(**changed: object) -> dict[str, object]:
    off = {"R_ohm": 1.1, "L_H": 0.9, "ke_V_s_rad": 0.92, "kt_N_m_A": 1.0, "J_kg_m2": 1.08, "b_N_m_s_rad": 0.7}
    table = {name: {"value": TRUE[name] * off[name], "free": name != "kt_N_m_A"} for name in TRUE}
    return {**table, **changed}


def motor_recording(seed: int, rows: int = 1500, noise: float = 1.0, colour: float = 0.0):
    """Motor by SciPy's matrix exponential, speed and current with noise (AR(1) where `colour` > 0)."""
    rng = np.random.default_rng(seed)
    a = np.array([[-8.0 / 2e-3, -0.02 / 2e-3, 0.0], [0.02 / 3e-6, -4e-6 / 3e-6, 0.0], [0.0, 1.0, 0.0]])
    b = np.array([[1.0 / 2e-3], [0.0], [0.0]])
    step = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, 4))]]) * 1e-3)
    drive = np.repeat(rng.choice([-12.0, -5.0, 5.0, 12.0], rows // 30 + 1), 30)[:rows]
    state, truth = np.zeros(3), np.zeros((rows, 3))
    for k in range(rows - 1):
        state = step[:3, :3] @ state + step[:3, 3] * drive[k]
        truth[k + 1] = state
    white = rng.normal(size=(rows, 3)) * np.array([0.01, 1.0, 0.002]) * noise
    shown = truth + scipy.signal.lfilter([math.sqrt(1.0 - colour**2)], [1.0, -colour], white, axis=0)
    columns = {"voltage_V": drive, "current_A": shown[:, 0], "speed_rad_s": shown[:, 1], "position_rad": shown[:, 2]}
    return make_recording(np.arange(rows) * 1e-3, columns, f"motor {seed}", "")


def lag_recording(kind: str, seed: int, noise: float, delay: float, constants: dict[str, float], rows: int = 1200):
    """A lag by SciPy's lsim on a grid twenty times finer than the rows."""
    rng = np.random.default_rng(seed)
    fine, step = 20, 0.01
    drive = np.repeat(rng.normal(size=rows // 20), 20)
    held = np.repeat(drive, fine)
    late = np.concatenate([np.zeros(round(delay / step * fine)), held])[: len(held)]
    if kind == "first_order":
        system = ([constants["gain"]], [constants["time_constant_s"], 1.0])
    else:
        w, z = constants["natural_frequency_rad_s"], constants["damping_ratio"]
        system = ([constants["gain"] * w**2], [1.0, 2.0 * z * w, w**2])
    grid = np.arange(len(held)) * step / fine
    _, output, _ = scipy.signal.lsim(system, late, grid, interp=False)
    shown = output[::fine] + noise * rng.normal(size=rows)
    return make_recording(grid[::fine], {"u": drive, "y": shown}, f"{kind} {seed}", "")


LAGS = {
    "first_order": {"gain": 2.5, "time_constant_s": 0.08, "delay_s": 0.0235},
    "second_order": {"gain": -0.7, "natural_frequency_rad_s": 18.0, "damping_ratio": 0.25, "delay_s": 0.041},
}


def values(result: Fit) -> dict[str, float]:
    return {p.name: p.value for p in result.plant.parameters}


@pytest.mark.parametrize("kind", LAGS)
def test_lag_is_recovered_from_nothing(kind: str) -> None:
    truth = LAGS[kind]
    train = [lag_recording(kind, seed, 0.02, truth["delay_s"], truth) for seed in (0, 1)]
    test = [lag_recording(kind, 5, 0.02, truth["delay_s"], truth)]
    result = fit(make_plant(kind, "u", ["y"], {}), train, test, NONE)
    for parameter in result.plant.parameters:
        reach = 4.0 * parameter.deviation
        assert abs(parameter.value - truth[parameter.name]) < reach
        assert reach < 0.1 * abs(truth[parameter.name])
    assert result.noise["y"] == pytest.approx(0.02, rel=0.06)
    assert result.test[0].scores["y"].rmse == pytest.approx(0.02, rel=0.1)
    assert result.warnings == ()


@pytest.mark.parametrize("outputs", [("speed_rad_s", "current_A"), ("current_A", "position_rad")])
def test_motor_is_recovered_from_a_wrong_nameplate(outputs: tuple[str, ...]) -> None:
    train = [motor_recording(0), motor_recording(1)]
    result = fit(make_plant("dc_motor", "voltage_V", outputs, nameplate()), train, [motor_recording(2)], NONE)
    for parameter in result.plant.parameters:
        if parameter.free:
            assert abs(parameter.value - TRUE[parameter.name]) < 4.0 * parameter.deviation
            assert parameter.deviation < 0.05 * TRUE[parameter.name]
        else:
            assert (parameter.value, parameter.deviation) == (TRUE[parameter.name], None)
    assert result.free == ("R_ohm", "L_H", "ke_V_s_rad", "J_kg_m2", "b_N_m_s_rad")
    assert result.covariance.shape == (5, 5)
    sizes = {"speed_rad_s": 1.0, "current_A": 0.01, "position_rad": 0.002}
    for name in outputs:
        assert result.noise[name] == pytest.approx(sizes[name], rel=0.06)
        assert result.test[0].scores[name].rmse == pytest.approx(sizes[name], rel=0.06)


def test_noiseless_data_give_the_parameters_to_many_digits() -> None:
    outputs = ("speed_rad_s", "current_A")
    result = fit(make_plant("dc_motor", "voltage_V", outputs, nameplate()), [motor_recording(0, noise=0.0)], [], NONE)
    for name, value in values(result).items():
        assert value == pytest.approx(TRUE[name], rel=1e-5)


@pytest.mark.parametrize("colour", [0.0, pytest.param(0.9, marks=pytest.mark.slow)])
def test_intervals_cover_the_truth_as_often_as_they_say(colour: float) -> None:
    truth, hits, tries = LAGS["first_order"], 0, 0
    clean = lag_recording("first_order", 0, 0.0, truth["delay_s"], truth, rows=800)
    plant = make_plant("first_order", "u", ["y"], truth)
    for seed in range(60):
        white = np.random.default_rng(100 + seed).normal(size=900)
        noise = 0.1 * scipy.signal.lfilter([math.sqrt(1.0 - colour**2)], [1.0, -colour], white)[100:]
        columns = {"u": clean.columns["u"], "y": clean.columns["y"] + noise}
        result = fit(plant, [make_recording(clean.time, columns, "noisy", "")], [], NONE)
        for parameter in result.plant.parameters:
            low, high = parameter.interval_95
            hits += low <= truth[parameter.name] <= high
            tries += 1
    assert 0.88 <= hits / tries <= 0.99


def test_a_start_far_off_still_finds_the_motor() -> None:
    far = {name: {"value": TRUE[name] * f, "free": True} for name, f in zip(TRUE, (4, 0.2, 0.4, 1, 5, 8), strict=True)}
    far["kt_N_m_A"] = {"value": 0.02, "free": False}
    result = fit(make_plant("dc_motor", "voltage_V", ["speed_rad_s", "current_A"], far), [motor_recording(0)], [], NONE)
    for name, value in values(result).items():
        assert value == pytest.approx(TRUE[name], rel=0.05)


def test_what_cannot_be_told_apart_is_named_and_gets_no_interval() -> None:
    free = {name: {"value": 0.9 * TRUE[name], "free": True} for name in TRUE}
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s", "current_A"], free)
    result = fit(plant, [motor_recording(0)], [], NONE)
    by_name = {p.name: p for p in result.plant.parameters}
    assert {n for n, p in by_name.items() if p.deviation is None} == {"kt_N_m_A", "J_kg_m2", "b_N_m_s_rad"}
    assert by_name["R_ohm"].deviation < 0.1
    (said,) = result.warnings
    assert "kt_N_m_A, J_kg_m2, b_N_m_s_rad cannot be told apart" in said
    assert "fix 1 of them with free = false" in said
    assert by_name["J_kg_m2"].value / by_name["kt_N_m_A"].value == pytest.approx(3e-6 / 0.02, rel=0.01)
    assert by_name["kt_N_m_A"].value == pytest.approx(0.018, rel=0.2)
    assert np.isnan(result.covariance).sum() == 36 - 9


def test_speed_alone_leaves_three_combinations_open() -> None:
    free = {name: {"value": 0.9 * TRUE[name], "free": True} for name in TRUE}
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], free)
    result = fit(plant, [motor_recording(0)], [], NONE)
    assert "3 combination(s)" in result.warnings[0]
    assert all(p.deviation is None for p in result.plant.parameters)
    assert result.train[0].scores["speed_rad_s"].fit_percent > 98.0


def test_a_parameter_without_trace_stays_as_given() -> None:
    drive = np.zeros(400)
    drive[0] = 1.0
    time = np.arange(400) * 0.01
    noise = 0.01 * np.random.default_rng(0).normal(size=400)
    recording = make_recording(time, {"u": drive, "y": noise}, "rest", "")
    plant = make_plant(
        "first_order", "u", ["y"], {"gain": {"value": 0.0, "free": False}, "time_constant_s": 0.1, "delay_s": 0.02}
    )
    result = fit(plant, [recording], [], NONE)
    assert values(result)["delay_s"] == pytest.approx(0.02, rel=1e-4)
    assert "delay_s leaves no trace" in " ".join(result.warnings)


def test_delay_that_is_not_there_ends_at_its_bound() -> None:
    truth = {**LAGS["first_order"], "delay_s": 0.0}
    result = fit(
        make_plant("first_order", "u", ["y"], {}), [lag_recording("first_order", 0, 0.05, 0.0, truth)], [], NONE
    )
    delay = result.plant.parameters[2]
    low, high = delay.interval_95
    assert (low, delay.value >= 0.0) == (0.0, True)
    assert high < 0.01
    assert "delay_s cannot be told from 0" in result.warnings[0]


def test_given_and_fixed_parameters_are_kept_while_others_are_guessed() -> None:
    truth = LAGS["second_order"]
    given = {"delay_s": {"value": truth["delay_s"], "free": False}, "damping_ratio": {"value": 0.3, "free": True}}
    recording = lag_recording("second_order", 0, 0.02, truth["delay_s"], truth)
    result = fit(make_plant("second_order", "u", ["y"], given), [recording], [], NONE)
    assert result.free == ("gain", "natural_frequency_rad_s", "damping_ratio")
    for name, value in values(result).items():
        assert value == pytest.approx(truth[name], rel=0.03)


def test_plant_without_free_parameters_is_only_scored() -> None:
    fixed = {name: {"value": TRUE[name], "free": False} for name in TRUE}
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], fixed)
    result = fit(plant, [motor_recording(0)], [motor_recording(1)], NONE)
    assert result.free == ()
    assert values(result) == TRUE
    assert result.train[0].scores["speed_rad_s"].rmse == pytest.approx(1.0, rel=0.06)


def test_initial_state_is_fitted_not_assumed() -> None:
    long = motor_recording(0, rows=1500)
    cut = {name: column[700:] for name, column in long.columns.items()}
    recording = make_recording(long.time[700:], cut, "cut", "")
    exact = {name: {"value": TRUE[name], "free": False} for name in TRUE}
    plant = make_plant("dc_motor", "voltage_V", ["position_rad", "speed_rad_s"], exact)
    start = fit_start(plant, recording, constants_of(plant), NONE)
    assert start[1] == pytest.approx(cut["speed_rad_s"][0], abs=4.0)
    assert start[2] == pytest.approx(cut["position_rad"][0], abs=0.01)
    result = fit(make_plant("dc_motor", "voltage_V", ["speed_rad_s", "current_A"], nameplate()), [recording], [], NONE)
    assert values(result)["R_ohm"] == pytest.approx(8.0, rel=0.02)


def test_an_output_tells_where_a_recording_begins_by_its_noise_and_not_by_how_far_it_goes() -> None:
    """Position to a millionth of a radian, that hardly moves, beside a speed that goes far and is read to 1 rad/s."""
    long = motor_recording(0, rows=600)
    rng = np.random.default_rng(1)
    exact = make_plant(
        "dc_motor",
        "voltage_V",
        ["position_rad", "speed_rad_s"],
        {name: {"value": TRUE[name], "free": False} for name in TRUE},
    )
    course = course_of(exact, make_recording(long.time, {"voltage_V": long.columns["voltage_V"]}, "drive", ""))
    outputs = simulator(exact, "zoh").run(course, constants_of(exact), np.zeros(3))
    outputs += rng.normal(size=outputs.shape) * [1e-6, 1.0]
    cut = slice(300, None)
    columns = {"voltage_V": long.columns["voltage_V"][cut]}
    columns |= {"position_rad": outputs[cut, 0], "speed_rad_s": np.clip(outputs[cut, 1], -40.0, 40.0)}
    recording = make_recording(long.time[cut], columns, "clipped", "")
    start = fit_start(exact, recording, constants_of(exact), NONE)
    assert start[2] == pytest.approx(outputs[300, 0], abs=2e-5), "a clipped speed says nothing against it"


def test_test_recordings_never_move_a_parameter() -> None:
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s", "current_A"], nameplate())
    train = [motor_recording(0)]
    alone = fit(plant, train, [], NONE)
    judged = fit(plant, train, [motor_recording(9, noise=50.0)], NONE)
    assert values(alone) == values(judged)


def test_windows_save_a_plant_that_integrates_from_its_own_drift() -> None:
    """A pushed angle far from home: the load it also feels is not in the model and adds up over the whole recording."""
    clean = motor_recording(0, rows=4000)
    pull = 0.4 * np.sin(2.0 * np.pi * clean.time / 1.7)
    columns = {
        "voltage_V": clean.columns["voltage_V"],
        "position_rad": clean.columns["position_rad"] + np.cumsum(pull) * 0.05,
    }
    drifting = make_recording(clean.time, columns, "drifting", "")
    free = {name: {"value": TRUE[name], "free": name == "R_ohm"} for name in TRUE}
    plant = make_plant("dc_motor", "voltage_V", ["position_rad"], free)
    whole = fit(plant, [drifting], [drifting], NONE)
    cut = fit(plant, [drifting], [drifting], Conditioning(window_s=0.25))
    assert cut.train[0].starts.shape == (16, 3)
    assert whole.train[0].starts.shape == (1, 3)
    assert cut.train[0].simulated.shape == (4000, 1)
    assert cut.test[0].scores["position_rad"].rmse < 0.5 * whole.test[0].scores["position_rad"].rmse
    assert abs(values(cut)["R_ohm"] - 8.0) < 1.0


def test_windows_leave_a_sound_fit_where_it_was() -> None:
    truth = LAGS["first_order"]
    recording = lag_recording("first_order", 0, 0.02, truth["delay_s"], truth)
    whole = fit(make_plant("first_order", "u", ["y"], {}), [recording], [], NONE)
    cut = fit(make_plant("first_order", "u", ["y"], {}), [recording], [], Conditioning(window_s=2.0))
    for one, other in zip(whole.plant.parameters, cut.plant.parameters, strict=True):
        assert other.value == pytest.approx(one.value, abs=3.0 * one.deviation)
        assert abs(other.value - truth[other.name]) < 4.0 * other.deviation


def test_example_finds_the_motor_its_recordings_were_made_with() -> None:
    folder = Path(__file__).resolve().parents[3] / "examples" / "wheel_speed"
    project = tomllib.loads((folder / "wheel_speed.toml").read_text())
    made = runpy.run_path(str(folder / "make_recordings.py"), run_name="read_only")
    plant = make_plant("dc_motor", "voltage_V", project["plant"]["outputs"], project["plant"]["parameters"])
    train, test = (
        [read_recording(folder / name, {}) for name in project["recordings"][part]] for part in ("train", "test")
    )
    result = fit(plant, train, test, NONE)
    assert result.warnings == ()
    truth = dict(zip(TRUE, (made[name] for name in ("R", "L", "KE", "KT", "J", "B")), strict=True))
    for parameter in result.plant.parameters:
        if parameter.free:
            assert abs(parameter.value - truth[parameter.name]) < 4.0 * parameter.deviation
            assert parameter.deviation < 0.02 * parameter.value
    assert result.test[0].scores["speed_rad_s"].fit_percent > 99.0
    assert result.test[0].scores["current_A"].fit_percent > 90.0


def test_progress_rises_to_the_end() -> None:
    seen: list[tuple[float, str]] = []
    plant = make_plant("dc_motor", "voltage_V", ["speed_rad_s", "current_A"], nameplate())
    fit(plant, [motor_recording(0)], [], NONE, lambda fraction, label: seen.append((fraction, label)))
    fractions = [fraction for fraction, _ in seen]
    assert fractions == sorted(fractions)
    assert 0.0 <= fractions[0] < fractions[-1] <= 1.0
    assert all(label for _, label in seen)


def test_useless_recordings_are_refused_by_name() -> None:
    plant = make_plant("first_order", "u", ["y"], {})
    time = np.arange(100) * 0.01
    wave = np.sin(time)
    for columns, words in (
        ({"u": np.zeros(100), "y": wave}, "bench: the input is zero"),
        ({"u": wave, "y": np.ones(100)}, "bench: column y never changes"),
        ({"u": wave}, "bench: column y is missing"),
    ):
        with pytest.raises(IdentifyError, match=words):
            fit(plant, [make_recording(time, columns, "bench", "")], [], NONE)
    with pytest.raises(IdentifyError, match=r"recordings\.train is empty"):
        fit(plant, [], [], NONE)


def test_scores_match_their_formulas() -> None:
    measured, simulated = np.array([1.0, 2.0, 3.0, 6.0]), np.array([1.0, 2.5, 3.0, 5.0])
    found = scores(measured, simulated)
    assert found.rmse == pytest.approx(math.sqrt(1.25 / 4.0))
    assert found.mae == pytest.approx(1.5 / 4.0)
    assert found.r2 == pytest.approx(1.0 - 1.25 / 14.0)
    assert found.fit_percent == pytest.approx(100.0 * (1.0 - math.sqrt(1.25 / 14.0)))
    assert math.isnan(scores(np.ones(4), simulated).fit_percent)
