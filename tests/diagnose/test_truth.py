"""The benchmark's truth and the simulator that fits it, moved by other means, agree below a sensor's resolution."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import COLUMN, single_case, write_case
from bench.diagnose.truth import FINE, Sensor, read, run
from firmloop.identify.plants.attach import parameters_of, with_effects
from firmloop.identify.plants.plant import EffectUse, Plant
from firmloop.identify.recordings.recording import Recording, read_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.superset import superset
from firmloop.project.project import read_project
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import BY_NAME

TRUE = {
    "R_ohm": "R", "L_H": "L", "ke_V_s_rad": "ke", "kt_N_m_A": "kt", "J_kg_m2": "J", "b_N_m_s_rad": "b",
    "mass_kg": "J", "b_N_s_m": "b",
}  # fmt: skip
STEP = {True: 2.0 * np.pi / 4096, False: 5e-6}  # of the positions of a blind case, rad and m


def made(folder: Path, machine: str, name: str) -> tuple[Plant, Recording]:
    """Return the plant as it truly is, with what is concealed, and the recording of its noise-free outputs."""
    motor = BY_NAME[machine].motor
    sensors = ("position", "current") if motor else ("position", "speed")
    case = single_case(7, name, BY_NAME[machine], sensors, "steps", False, 1.0)
    write_case(case, folder / "case", folder / "labels")
    (hidden,) = case.hidden
    plant = plant_of(read_project(folder / "case" / "project.toml"))
    values = {p.name: case.machine.values[TRUE[p.name]] for p in plant.parameters}
    plant = replace(plant, parameters=tuple(replace(p, value=values[p.name]) for p in plant.parameters))
    output = COLUMN[motor][hidden.sensor[0]] if hidden.sensor else None
    parameters = [p.name for p in parameters_of(plant, name, output)]
    told = json.loads((folder / "labels" / "label.json").read_text(encoding="utf-8"))["effects"][name]
    figures = {p: next(value for word, value in told.items() if p.startswith(word)) for p in parameters}
    return with_effects(plant, [EffectUse(name, output, figures, ())]), read_recording(folder / "labels/train.csv", {})


@pytest.mark.parametrize(
    ("machine", "name"),
    [
        *(("flat_motor", name) for name in ("brush_drop", "coulomb_friction", "stribeck_friction", "cogging_torque")),
        *(("flat_motor", name) for name in ("torque_constant_saturation", "resistance_heating", "presliding_friction")),
        *(("linear_stage", name) for name in ("coulomb_friction", "quadratic_drag", "dead_zone", "input_delay")),
    ],
)
def test_two_simulators_agree(machine: str, name: str, tmp_path: Path) -> None:
    plant, clean = made(tmp_path, machine, name)
    away = clean.columns[plant.outputs[0].name] - simulate(plant, clean, None)[:, 0]
    assert float(np.std(away)) < STEP[machine != "linear_stage"] / np.sqrt(12.0)


@pytest.mark.parametrize("recorded", [False, True], ids=["simulated angle", "recorded angle"])
def test_an_eccentric_encoder_shows_the_angle_with_its_own_error(recorded: bool, tmp_path: Path) -> None:
    plant, clean = made(tmp_path, "flat_motor", "eccentric_encoder")
    engine = superset(plant)
    engine.follow(recorded)
    at_zero = np.zeros(len(engine.states))
    away = clean.columns["position_rad"] - engine.simulate(clean, {}, at_zero)[:, 0]
    assert float(np.std(away)) < STEP[True] / np.sqrt(12.0)


def test_a_wave_of_many_periods_a_turn_follows_a_recorded_angle_between_its_rows(tmp_path: Path) -> None:
    plant, clean = made(tmp_path, "small_motor", "torque_ripple")
    engine = superset(plant)
    engine.follow(True)
    away = clean.columns["position_rad"] - engine.simulate(clean, {}, np.zeros(len(engine.states)))[:, 0]
    assert float(np.std(away)) < STEP[True] / np.sqrt(12.0)


def test_the_truth_lags_behind_a_ramp_by_its_time_constant() -> None:
    step, rows, late = 1e-3, 200, 3e-3
    ramp = np.arange(rows * FINE) * step / FINE
    seen = read("speed", {"speed": ramp}, step, rows, Sensor("sensor_lag", {"time_constant": late}), 0.0)
    time = np.arange(rows) * step
    assert np.allclose(seen, time - late * (1.0 - np.exp(-time / late)), rtol=0.0, atol=1e-12)


def test_the_truth_does_not_lag_behind_rows_that_a_slew_rate_reaches_at_once() -> None:
    command = 0.002 * np.arange(400.0)  # 200 times slower than the rate
    constants = {"is_motor": 1.0, "R": 2.0, "L": 1e-3, "ke": 0.02, "kt": 0.02, "J": 1e-7, "b": 1e-8}
    free, held = (
        run({**constants, **slow}, command, 1e-3, None, np.zeros(400))[1]["position"][-1]
        for slow in ({}, {"slew": 400.0})
    )
    late = 0.002 / (2.0 * 400.0) * (0.002 * 400.0 / 0.02)  # s by which its ramps are late, times the speed that u makes
    assert free - held == pytest.approx(late, rel=0.05)
