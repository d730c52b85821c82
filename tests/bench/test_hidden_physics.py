"""The benchmark's truths are what truth.json says, and what shows of them is told from the truth alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose import nulls, simulated, strangers
from bench.diagnose.hidden import read_truth, same_function
from bench.diagnose.linear_plants import motor_matrices, moved
from bench.diagnose.visible import least_left
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import EffectUse, Plant
from firmloop.identify.recordings.recording import read_recording
from firmloop.identify.simulation.simulate import measured, simulate
from firmloop.project.project import read_project
from firmloop.stages.plant import plant_of

MOTOR = {
    "R_ohm": 2.0, "L_H": 1e-3, "ke_V_s_rad": 0.03, "kt_N_m_A": 0.03, "J_kg_m2": 1e-5, "b_N_m_s_rad": 1e-5,
}  # fmt: skip


def true_plant(folder: Path) -> Plant:
    """Return the plant of a case at its true values."""
    plant, truth = plant_of(read_project(folder / "project.toml")), read_truth(folder)
    return replace(plant, parameters=tuple(replace(p, value=truth.plant[p.name]) for p in plant.parameters))


def left_over_noise(folder: Path, plant: Plant) -> np.ndarray:
    """Return what a plant leaves of the recordings over the noise that the truth added (r,)."""
    aways, noise = [], read_truth(folder).noise
    for file in sorted(folder.glob("train_*.csv")):
        recording = read_recording(file, {})
        away = measured(plant, recording) - simulate(plant, recording, None)
        aways.append(away - np.mean(away, axis=0))  # a position begins at its first reading, noise and all
    return np.std(np.concatenate(aways), axis=0) / np.array([noise[signal.name] for signal in plant.outputs])


@pytest.mark.parametrize("seed", range(12))
def test_a_null_case_is_its_true_plant_and_noise(seed: int, tmp_path: Path) -> None:
    nulls.write(seed, tmp_path)
    assert read_truth(tmp_path).visible == 0.0
    assert left_over_noise(tmp_path, true_plant(tmp_path)) == pytest.approx(1.0, abs=0.35)


def test_a_simulated_case_has_no_test_recording_unless_asked(tmp_path: Path) -> None:
    simulated.write(0, "single", 0, tmp_path / "without")
    simulated.write(0, "single", 1, tmp_path / "with")
    parts = [read_project(tmp_path / name / "project.toml").recordings for name in ("without", "with")]
    assert [len(part.test) for part in parts if part] == [0, 1]
    first, second = (read_truth(tmp_path / name) for name in ("without", "with"))
    assert [each.parameters for each in first.hidden] == [each.parameters for each in second.hidden]


def test_what_a_refit_of_the_plant_can_take_up_is_not_visible() -> None:
    drive = np.repeat([0.0, 12.0, -6.0, 3.0], 200)
    true = moved(motor_matrices({**MOTOR, "b_N_m_s_rad": 2e-5}, ("speed_rad_s",)), 1e-3, drive)
    noise = 1.0

    def simulation(at: np.ndarray) -> np.ndarray:
        values = {**MOTOR, "b_N_m_s_rad": MOTOR["b_N_m_s_rad"] * float(np.exp(at[0]))}
        return moved(motor_matrices(values, ("speed_rad_s",)), 1e-3, drive) / noise

    assert np.sqrt(np.mean((true / noise - simulation(np.zeros(1))) ** 2)) > 1.0
    assert least_left(simulation, true / noise, np.zeros(1)) < 0.3
    dragged = true * (1.0 - 0.1 * np.abs(true) / np.max(np.abs(true)))
    assert least_left(simulation, dragged / noise, np.zeros(1)) > 1.0


def test_sets_of_one_function_follow_the_sensors() -> None:
    assert same_function("input_delay", ("speed_rad_s",)) == [["sensor_delay"]]
    assert same_function("input_delay", ("speed_rad_s", "current_A")) == []
    assert ["sensor_offset"] in same_function("load_torque", ("speed_rad_s",))
    assert same_function("asymmetric_friction", ("position_rad", "current_A")) == [["coulomb_friction", "load_torque"]]


# One seed an effect: the first at which it is drawn.
DRAWN = {101: "quadratic_drag", 103: "presliding_friction", 114: "flexible_coupling", 159: "gravity_torque",
         124: "input_delay", 130: "return_spring", 165: "load_torque", 200: "cogging_torque"}  # fmt: skip


LONGEST = ("input_delay", "load_torque")  # to write: their truths are searched for what a refit takes up


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, id=name, marks=[pytest.mark.slow] if name in LONGEST else []) for seed, name in DRAWN.items()],
)
def test_what_strangers_hide_is_what_the_library_calls_so(seed: int, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'firmloop[bench]'")
    strangers.write(seed, tmp_path)
    (hidden,) = read_truth(tmp_path).hidden
    assert hidden.name == DRAWN[seed]
    plant, second = true_plant(tmp_path), hidden.parameters.get("load_inertia_kg_m2", 0.0)
    own = {"J_kg_m2": read_truth(tmp_path).plant["J_kg_m2"] - second}
    plant = replace(plant, parameters=tuple(replace(p, value=own.get(p.name, p.value)) for p in plant.parameters))
    there = with_effects(plant, [EffectUse(hidden.name, hidden.output, hidden.parameters)])
    assert left_over_noise(tmp_path, there) == pytest.approx(1.0, abs=0.1)
