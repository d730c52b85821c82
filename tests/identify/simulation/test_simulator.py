"""The compiled simulator against SciPy's integrator and against finite differences."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kind import equations
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse, Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import constants_of, course_of, rest_start, simulate, simulator

MOTOR = {
    "R_ohm": 8.0,
    "L_H": 1e-3,
    "ke_V_s_rad": 0.02,
    "kt_N_m_A": 0.02,
    "J_kg_m2": 3e-6,
    "b_N_m_s_rad": 3e-6,
}


def uneven(rows: int, step: float, input_name: str):
    rng = np.random.default_rng(7)
    time = np.cumsum(step * rng.uniform(0.2, 1.8, rows)) + 3.0
    time[rows // 2 :] += 12.3 * step
    return make_recording(time, {input_name: np.repeat(rng.normal(size=rows // 5 + 1) * 8.0, 5)[:rows]}, "uneven", "")


@dataclass(frozen=True)
class Truth:
    """The same plant written by hand: rate(t, x, u), reading(x, u), delay."""

    rate: Callable[[float, np.ndarray, float], list[float]]
    reading: Callable[[np.ndarray, float], list[float]]
    delay: float


def by_scipy(truth: Truth, recording, start: np.ndarray) -> np.ndarray:
    """Integrate from switch to switch; nothing of the simulator under test is used."""
    (drive,) = recording.columns.values()
    switches = recording.time + truth.delay
    events = np.unique(np.concatenate([recording.time, switches[switches < recording.time[-1]]]))
    state, readings = start, []
    for k, moment in enumerate(events):
        if moment in recording.time:
            past = np.flatnonzero(switches < moment)
            readings.append(truth.reading(state, drive[past[-1]] if len(past) else 0.0))
        if k + 1 == len(events):
            break
        past = np.flatnonzero(switches <= moment)
        acting = drive[past[-1]] if len(past) else 0.0
        span = (moment, events[k + 1])
        state = solve_ivp(truth.rate, span, state, "Radau", rtol=1e-9, atol=1e-11, args=(acting,)).y[:, -1]
    return np.array(readings)


def motor_truth(inductance: float, reading: Callable[[np.ndarray, float], list[float]]) -> Truth:
    def rate(_: float, x: np.ndarray, u: float) -> list[float]:
        slopes = [(u - 8.0 * x[0] - 0.02 * x[1]) / inductance, (0.02 * x[0] - 3e-6 * x[1]) / 3e-6, x[1]]
        return slopes[: len(x)]

    return Truth(rate, reading, 0.0)


STIFF_FREE = Truth(
    lambda _, x, u: [(0.02 * (u - 0.02 * x[0]) / 8.0 - 3e-6 * x[0]) / 3e-6],
    lambda x, u: [x[0], (u - 0.02 * x[0]) / 8.0],
    0.0,
)
FIRST = Truth(lambda _, x, u: [(2.0 * u - x[0]) / 0.03], lambda x, u: [x[0]], 0.0)
SECOND = Truth(lambda _, x, u: [x[1], 3600.0 * (2.0 * u - x[0]) - 24.0 * x[1]], lambda x, u: [x[0]], 0.0171)
BENT = Truth(
    lambda _, x, u: [x[1], 400.0 * (0.05 * u - math.sin(x[0])) - 1.5 * x[1] * abs(x[1])],
    lambda x, u: [x[0] + 0.1 * x[1] ** 2 + 0.01 * u * 0.05],
    0.0137,
)


def motor(*outputs: str, **changed: object) -> Plant:
    return make_plant("dc_motor", "voltage_V", outputs, {**MOTOR, **changed})


def lag(kind: str, delay: float) -> Plant:
    shape = (
        {"time_constant_s": 0.03} if kind == "first_order" else {"natural_frequency_rad_s": 60.0, "damping_ratio": 0.2}
    )
    return make_plant(kind, "u", ["y"], {"gain": 2.0, "delay_s": delay, **shape})


def bent() -> Plant:
    """A plant that is linear neither in its state nor in its parameters: quadratic drag behind a delay."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 4)
    gain, frequency, drag, _ = ca.vertsplit(p)
    rate = ca.vertcat(x[1], frequency**2 * (gain * u - ca.sin(x[0])) - drag * x[1] * ca.fabs(x[1]))
    made = lag("second_order", 0.0137)
    values = (0.05, 20.0, 1.5, 0.0137)
    return replace(
        made,
        parameters=tuple(replace(q, value=v) for q, v in zip(made.parameters, values, strict=True)),
        rate=equations("rate", x, u, p, rate),
        reading=equations("reading", x, u, p, x[0] + 0.1 * x[1] ** 2 + 0.01 * u * gain),
    )


NO_INDUCTANCE = motor("speed_rad_s", "current_A", L_H={"value": 0, "free": False})
CASES = {
    "motor": (motor("speed_rad_s", "current_A"), 1e-3, [0.3, -20.0], motor_truth(1e-3, lambda x, u: [x[1], x[0]])),
    "motor with position": (
        motor("position_rad", "current_A", "speed_rad_s"),
        1e-3,
        [0.1, 5.0, 2.0],
        motor_truth(1e-3, lambda x, u: [x[2], x[0], x[1]]),
    ),
    "motor with tiny inductance": (
        motor("speed_rad_s", "current_A", L_H=1e-7),
        1e-3,
        [0.0, 0.0],
        motor_truth(1e-7, lambda x, u: [x[1], x[0]]),
    ),
    "motor without inductance": (NO_INDUCTANCE, 1e-3, [9.0], STIFF_FREE),
    "first order": (lag("first_order", 0.0), 1e-2, [1.0], FIRST),
    "first order, delay": (lag("first_order", 0.0234), 1e-2, [1.0], replace(FIRST, delay=0.0234)),
    "first order, long delay": (lag("first_order", 0.31), 1e-2, [1.0], replace(FIRST, delay=0.31)),
    "second order, delay": (lag("second_order", 0.0171), 1e-2, [1.0, -4.0], SECOND),
    "nonlinear, delay": (bent(), 1e-2, [0.4, 0.0], BENT),
}


@pytest.mark.parametrize("case", CASES)
def test_agrees_with_scipy_on_uneven_rows(case: str) -> None:
    plant, step, start, truth = CASES[case]
    recording = uneven(40, step, plant.inputs[0].name)
    ours, theirs = simulate(plant, recording, np.array(start)), by_scipy(truth, recording, np.array(start))
    scale = np.max(np.abs(theirs), axis=0)
    tolerance = 2e-6 if case.startswith("nonlinear") else 1e-7
    np.testing.assert_allclose(ours / scale, theirs / scale, atol=tolerance)


@pytest.mark.parametrize("case", CASES)
def test_sensitivities_agree_with_finite_differences(case: str) -> None:
    plant, step, begin, _ = CASES[case]
    start, recording = np.array(begin), uneven(120, step, plant.inputs[0].name)
    engine, course, constants = simulator(plant), course_of(plant, recording), constants_of(plant)
    which = [k for k, p in enumerate(plant.parameters) if p.value != 0.0]
    # Runge-Kutta's substeps move with the delay, which costs the derivative its own truncation error.
    tolerance = 5e-4 if case.startswith("nonlinear") else 2e-4
    outputs, slopes = engine.run_with_slopes(course, constants, start, which)
    np.testing.assert_allclose(outputs, engine.run(course, constants, start), rtol=1e-12, atol=1e-12)
    for place, k in enumerate(which):
        # A delay may not move a switch across a row: the true derivative jumps there.
        reach = 1e-7 if plant.parameters[k].name == plant.delay else 1e-4 * constants[k]
        up, down = constants.copy(), constants.copy()
        up[k] += reach
        down[k] -= reach
        slope = (engine.run(course, up, start) - engine.run(course, down, start)) / (2.0 * reach)
        scale = np.max(np.abs(slope))
        if scale * constants[k] > 1e-4 * np.max(np.abs(outputs)):
            np.testing.assert_allclose(slopes[:, :, place] / scale, slope / scale, atol=tolerance)
    for i in range(engine.states):
        up, down = start.copy(), start.copy()
        up[i] += 1e-4
        down[i] -= 1e-4
        slope = (engine.run(course, constants, up) - engine.run(course, constants, down)) / 2e-4
        np.testing.assert_allclose(slopes[:, :, len(which) + i], slope, atol=2e-5 * max(np.max(np.abs(slope)), 1e-9))


def test_output_is_read_before_the_input_of_its_row_acts() -> None:
    plant = make_plant("dc_motor", "voltage_V", ["current_A"], {**MOTOR, "L_H": {"value": 0.0, "free": False}})
    voltage = np.array([8.0, 16.0, 0.0, 0.0])
    recording = make_recording(np.arange(4) * 1e-9, {"voltage_V": voltage}, "r", "")
    np.testing.assert_allclose(simulate(plant, recording, None)[:, 0], [0.0, 1.0, 2.0, 0.0], atol=1e-6)


def test_starts_at_the_first_position_and_otherwise_at_rest() -> None:
    plant = motor("position_rad", "speed_rad_s")
    columns = {"voltage_V": np.zeros(5), "position_rad": np.full(5, 1.25), "speed_rad_s": np.full(5, 40.0)}
    first = simulate(plant, make_recording(np.arange(5) * 0.01, columns, "r", ""), None)
    np.testing.assert_array_equal(first, np.tile([1.25, 0.0], (5, 1)))


@pytest.mark.parametrize(
    ("uses", "start"),
    [
        ([("sensor_offset", {"offset_rad": 0.5})], 0.75),
        ([("sensor_gain", {"gain": 2.0})], 0.625),
        ([("sensor_gain", {"gain": 2.0}), ("sensor_offset", {"offset_rad": 0.5})], 0.375),
        ([("eccentric_encoder", {"amplitude_rad": 0.2, "phase_rad": -1.0})], 1.20858487),  # x + 0.2 sin(x - 1) = 1.25
    ],
)
def test_starts_where_the_reading_with_its_offset_and_gain_is_the_first(
    uses: list[tuple[str, dict[str, float]]], start: float
) -> None:
    plant = motor("position_rad")
    plant = with_effects(plant, [EffectUse(name, None, values) for name, values in uses])
    columns = {"voltage_V": np.zeros(5), "position_rad": np.full(5, 1.25)}
    recording = make_recording(np.arange(5) * 0.01, columns, "r", "")
    place = [signal.name for signal in plant.states].index("position_rad")
    np.testing.assert_allclose(rest_start(plant, recording)[place], start)
    np.testing.assert_allclose(simulate(plant, recording, None), np.full((5, 1), 1.25))


def test_rows_need_no_output_column_to_be_simulated() -> None:
    recording = make_recording(np.arange(5) * 0.01, {"voltage_V": np.ones(5)}, "r", "")
    assert simulate(motor("speed_rad_s"), recording, None).shape == (5, 1)


def test_missing_input_is_named() -> None:
    recording = make_recording(np.arange(5.0), {"speed_rad_s": np.ones(5)}, "bench.csv", "")
    with pytest.raises(IdentifyError, match=r"bench\.csv: column voltage_V is missing"):
        simulate(motor("speed_rad_s"), recording, None)


def test_divergence_is_named_with_its_time() -> None:
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 4)
    runaway = replace(bent(), rate=equations("rate", x, u, p, 1e4 * x))
    with pytest.raises(IdentifyError, match=r"uneven: the simulated second_order grows without bound at 3\.\d+ s"):
        simulate(runaway, uneven(400, 1e-2, "u"), np.array([1.0, 1.0]))


@pytest.mark.parametrize(
    "case", ["motor", "first order, long delay", "second order, delay", "motor without inductance"]
)
def test_a_window_continues_where_the_recording_stood(case: str) -> None:
    plant, step, begin, _ = CASES[case]
    recording = uneven(120, step, plant.inputs[0].name)
    watched = replace(
        plant,
        outputs=plant.states,
        reading=ca.Function(
            "reading",
            [a := ca.SX.sym("x", len(plant.states)), ca.SX.sym("u"), ca.SX.sym("p", plant.rate.numel_in(2))],
            [a],
        ),
    )
    course, constants = course_of(plant, recording), constants_of(plant)
    states = simulator(watched).run(course, constants, np.array(begin))
    whole = simulator(plant).run(course, constants, np.array(begin))
    window = simulator(plant).run(replace(course, first=50, end=90), constants, states[50])
    np.testing.assert_allclose(window, whole[50:90], rtol=1e-9, atol=1e-9)


def test_two_runs_agree_in_every_bit() -> None:
    plant, recording = motor("speed_rad_s", "current_A"), uneven(300, 1e-3, "voltage_V")
    np.testing.assert_array_equal(simulate(plant, recording, None), simulate(plant, recording, None))


def test_a_long_recording_simulates_in_a_tenth_of_one_call_of_the_plant_a_row() -> None:
    rows = 10_000
    time = np.arange(rows) * 1e-3
    recording = make_recording(time, {"voltage_V": np.sign(np.sin(time * 9.0)) * 10.0}, "r", "")
    plant = motor("speed_rad_s", "current_A")
    engine, course, constants = simulator(plant), course_of(plant, recording), constants_of(plant)
    states, inputs, values = (np.zeros(plant.rate.numel_in(k)) for k in range(3))
    cpu = [clock.process_time()]
    engine.run_with_slopes(course, constants, np.zeros(2), range(6))
    cpu.append(clock.process_time())
    for _ in range(rows):
        plant.rate(states, inputs, values)
    assert 10.0 * (cpu[1] - cpu[0]) < clock.process_time() - cpu[1]
