"""Where a slow force pushes a stage towards its stop, intervals hold the truth; noise of readings alone does not."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.blind_cases import single_case, write_case
from bench.concealed import MACHINES
from diagnose.hypothesis import Scene, entered, first_point, make_scene
from diagnose.preflight import preflight
from diagnose.pushes import doubtful, with_pushes
from diagnose.refit import Fitted, deviations, ended, fit, noises_of
from firmloop.pipeline import plant_of, read_data
from firmloop.project import read_project
from identify.noise import Noise, white

STAGE = next(machine for machine in MACHINES if machine.name == "linear_stage")
CASES = 8


def _fitted(
    place: Path, seed: int, effect: str, sensors: tuple[str, ...], colored: bool
) -> tuple[Scene, Fitted, tuple[Noise, ...], float]:
    """Return a fit of one effect that begins at the truth, and the truth of its first parameter."""
    case = single_case(seed, effect, STAGE, sensors, "triangle", colored, 0.3)
    write_case(case, place / "case", place / "labels")
    project = read_project(place / "case" / "project.toml")
    plant, train = plant_of(project), read_data(project).train
    told = json.loads((place / "labels" / "label.json").read_text())["effects"][effect]
    scene = make_scene(plant, train, (), preflight(plant, train, ()).floors)
    cause = scene.cause(effect)
    assert cause is not None
    begin = first_point(scene, train)
    truth = next(iter(told.values()))
    values = entered(begin.values, cause, {**scene.starts[cause.label][-1], cause.keys[0]: truth})
    found = fit(scene, train, (cause,), type(begin)(values, begin.starts), [white(1e-3)] * len(sensors), 12)
    for _ in range(3):
        noises = noises_of(scene, found.residuals)
        found = fit(scene, train, (cause,), found.point, noises, 12)
    return scene, ended(scene, found, noises), noises, truth


def test_intervals_of_a_stop_hold_the_truth_under_a_slow_force(tmp_path: Path) -> None:
    held = {"readings": 0, "pushes": 0}
    for seed in range(CASES):
        scene, found, noises, truth = _fitted(tmp_path / str(seed), seed, "end_stop", ("position",), True)
        key = found.causes[0].keys[0]
        off = abs(found.point.values[key] - truth)
        for name, each in (("readings", found), ("pushes", with_pushes(scene, found, noises))):
            held[name] += off < 1.96 * deviations(each)[key]
    assert held["readings"] <= CASES // 2, "or the cases show nothing"
    assert held["pushes"] >= CASES - 1


def test_an_effect_is_certain_beside_pushes_that_do_not_make_it(tmp_path: Path) -> None:
    scene, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    assert doubtful(with_pushes(scene, found, noises), noises) is None
    little = {found.causes[0].keys[0]: 2.0 * deviations(with_pushes(scene, found, noises))[found.causes[0].keys[0]]}
    small = replace(found, point=replace(found.point, values={**found.point.values, **little}))
    assert doubtful(with_pushes(scene, small, noises), noises) is found.causes[0]
    assert doubtful(small, [white(noise.rms) for noise in noises]) is None


def test_pushes_say_no_more_than_noise_where_that_is_what_they_make(tmp_path: Path) -> None:
    scene, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), True)
    wider = with_pushes(scene, found, noises).wider
    assert wider is not None and np.all(wider < 2.0)


def test_noise_without_memory_is_no_push(tmp_path: Path) -> None:
    scene, found, noises, _ = _fitted(tmp_path, 3, "coulomb_friction", ("speed",), False)
    assert with_pushes(scene, found, noises) is found
