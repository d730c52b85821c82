"""Where the cost of a moment wanders, a fit finds the better place, and its interval is as wide as the cost allows."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from bench.blind_cases import single_case, write_case
from bench.concealed import MACHINES
from diagnose.hypothesis import Point, first_point, make_scene
from diagnose.preflight import preflight
from diagnose.profile import profiled
from diagnose.refit import cost_at, deviations, ended, fit, noises_of
from firmloop.pipeline import plant_of, read_data
from firmloop.project import read_project
from identify.noise import white

FLAT_MOTOR = next(machine for machine in MACHINES if machine.name == "flat_motor")


def test_a_moment_is_taken_to_its_best_place(tmp_path: Path) -> None:
    """The search of this case ends 24 ms off, twelve deviations, in a place of its own."""
    case = single_case(1003, "load_step", FLAT_MOTOR, ("speed", "current"), "mixed", True, 0.3)
    write_case(case, tmp_path / "case", tmp_path / "labels")
    project = read_project(tmp_path / "case" / "project.toml")
    plant, train = plant_of(project), read_data(project).train
    told = json.loads((tmp_path / "labels" / "label.json").read_text())["effects"]["load_step"]
    scene = make_scene(plant, train, (), preflight(plant, train, ()).floors)
    cause = scene.cause("load_step")
    assert cause is not None
    moment, torque = (next(key for key in cause.keys if key.endswith(end)) for end in (".time_s", ".torque_N_m"))
    begin = first_point(scene, train)
    place = Point({**begin.values, moment: told["time"] - 0.024, torque: told["torque"]}, begin.starts)
    found = fit(scene, train, (cause,), place, [white(1.0), white(0.1)], 12)
    for _ in range(3):
        noises = noises_of(scene, found.residuals)
        found = fit(scene, train, (cause,), found.point, noises, 12)
    stuck = ended(scene, found, noises)
    best = profiled(scene, stuck, noises)
    off = {name: abs(each.point.values[moment] - told["time"]) for name, each in (("stuck", stuck), ("best", best))}
    assert off["stuck"] > 5 * deviations(stuck)[moment], "or the case shows nothing"
    assert off["best"] < 1.96 * deviations(best)[moment] < 0.01
    true = Point({**best.point.values, moment: told["time"]}, best.point.starts)
    assert cost_at(scene, best, best.point, noises) < cost_at(scene, best, true, noises)
    assert best.wider is not None and np.all(best.wider >= 1.0)
