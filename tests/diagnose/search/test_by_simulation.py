"""Where a misfit is left that is no noise, simulations tell explanations apart, and no recording pays for another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from firmloop.diagnose.discrepancy.disturbance import balance_unit
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import first_point
from firmloop.identify.fitting.noise import white
from firmloop.identify.plants.per_recording import with_varying
from firmloop.identify.recordings.recording import make_recording
from firmloop.project.project import read_project
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import concealed, problem_of, said_of

HEATER = """schema = 1
name = "heater"
[recordings]
train = ["step.csv"]
[plant]
kind = "ode"
states = ["heater_C"]
inputs = ["heater_pct"]
[plant.outputs]
temperature_C = "heater_C"
[plant.derivatives]
heater_C = "(0.01*heater_pct - h_W_K*(heater_C - ambient_C))/C_J_K"
[plant.balances]
heater_C = { kind = "flow", per = "1/C_J_K" }
[plant.parameters]
h_W_K = { value = 0.015, free = true }
ambient_C = { value = 22, free = true }
C_J_K = { value = 3, free = true }
"""


def heated(folder: Path, seed: int) -> Path:
    """Heat a block whose sensor lags 19 s behind, in a room that wanders by 0.25 K; readings in steps of 0.32 K."""
    rng, room = np.random.default_rng(seed), np.random.default_rng(seed + 100)
    heater = sensor = wander = 0.0
    readings = np.empty(750)
    for k in range(750):
        readings[k] = 21.0 + sensor + 0.15 * rng.normal()
        for _ in range(10):
            rates = (1.0 - 0.02 * heater) / 4.0, (heater - sensor) / 19.0
            heater, sensor = heater + 0.1 * rates[0], sensor + 0.1 * rates[1]
    for k in range(750):
        wander += -wander / 40.0 + 0.25 * np.sqrt(2.0 / 40.0) * room.normal()
        readings[k] = np.round((np.round(readings[k] / 0.32) * 0.32 + wander) / 0.32) * 0.32
    table = np.column_stack([np.arange(750.0), np.full(750, 100.0), readings])
    np.savetxt(folder / "step.csv", table, delimiter=",", header="time_s,heater_pct,temperature_C", comments="")
    (folder / "project.toml").write_text(HEATER, encoding="utf-8")
    return folder / "project.toml"


def test_a_lag_that_drifts_hide_is_in_the_set_as_what_is_left_answers_the_input(tmp_path: Path) -> None:
    said = said_of(heated(tmp_path, 3))
    assert said["verdict"] == "ambiguous"
    (lag,) = (each for each in said["effects"] if each["name"] == "sensor_lag")
    low, high = lag["parameters"]["time_constant_s"]["ci95"]
    assert low < 19.0 < high


def test_an_equation_whose_gain_each_recording_has_for_itself_has_the_unit_of_its_flow(tmp_path: Path) -> None:
    plant = plant_of(read_project(heated(tmp_path, 0)))
    own = with_varying(plant, ["gain.temperature_C"])
    assert balance_unit(own, own.balances[0]) == balance_unit(plant, plant.balances[0])


def test_what_a_recording_weighs_is_what_a_fit_trades_it_for(tmp_path: Path) -> None:
    whole = problem_of(concealed(tmp_path, "coulomb_friction", 0.3, False))
    (seen,) = whole.train
    middle = len(seen.time) // 2
    halves = tuple(
        make_recording(seen.time[part], {name: each[part] for name, each in seen.columns.items()}, "half.csv", "")
        for part in (slice(None, middle), slice(middle, None))
    )
    problem, noises = replace(whole, train=halves), [white(1.0)] * len(whole.plant.outputs)
    begin, left = first_point(problem, problem.train), []
    for heavy in range(2):
        weights = {id(each): np.full(len(noises), 100.0 ** (k == heavy)) for k, each in enumerate(halves)}
        fitted = fit(replace(problem, memory={}, weights=weights), halves, (), begin, noises, 24)
        plain = fit(problem, halves, (), fitted.point, noises, 0)
        left.append([float(np.sum(part**2)) for part in plain.residuals])
    assert left[0][0] < left[1][0]
    assert left[1][1] < left[0][1]
