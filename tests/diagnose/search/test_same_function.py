"""Where a machine turns one way only, a load and dry friction are one function: both are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from firmloop.diagnose.model.candidate import extended, rated
from firmloop.diagnose.model.fit import Fitted, fit
from firmloop.diagnose.model.hypothesis import Problem, first_point
from firmloop.diagnose.policy import TIE
from firmloop.diagnose.search.exchange import retied
from firmloop.diagnose.search.harmless import by_simulation_error, same_function
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import problem_of

PROJECT = """schema = 1
name = "one_way"
[recordings]
train = ["train.csv"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = { value = 20.0, free = true }
time_constant_s = { value = 0.25, free = true }
delay_s = { value = 0.0, free = false }
"""


def _problem(folder: Path, lowest: float) -> Problem:
    rng = np.random.default_rng(3)
    step, rows = 0.01, 900
    drive = np.repeat(rng.uniform(lowest, 12.0, rows // 30), 30)
    speed = np.zeros(rows)
    for row in range(rows - 1):
        pulled = 20.0 * drive[row] - 15.0 * np.sign(speed[row]) - speed[row]
        speed[row + 1] = speed[row] + step / 0.25 * pulled
    speed += rng.normal(0.0, 0.3, rows)
    table = np.column_stack([step * np.arange(rows), drive, speed])
    np.savetxt(folder / "train.csv", table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    (folder / "project.toml").write_text(PROJECT, encoding="utf-8")
    return problem_of(folder / "project.toml")


def _with_friction(problem: Problem) -> Fitted:
    term = problem.term("coulomb_friction")
    assert term is not None
    bare = by_simulation_error(
        problem, fit(problem, problem.train, (), first_point(problem, problem.train), [white(1.0)], 24)
    )
    terms, point = extended(bare, term, problem.starts[term.label][0])
    return by_simulation_error(problem, fit(problem, problem.train, terms, point, [white(1.0)], 24))


def _names(found: tuple[Fitted, ...]) -> set[str]:
    return {name for each in found for name in each.names}


def test_a_load_stands_beside_friction_where_the_machine_turns_one_way(tmp_path: Path) -> None:
    problem = _problem(tmp_path, 4.0)
    assert "load_torque" in _names(same_function(problem, _with_friction(problem)))


def test_a_load_does_not_stand_beside_friction_where_the_machine_turns_both_ways(tmp_path: Path) -> None:
    problem = _problem(tmp_path, -12.0)
    assert "load_torque" not in _names(same_function(problem, _with_friction(problem)))


def test_what_tied_with_an_effect_is_tried_beside_what_was_found_later(tmp_path: Path) -> None:
    """On an input of two levels a limit and a scale are one function; a lag was found after either."""
    rows, step = 600, 0.01
    drive = np.where(np.arange(rows) // 50 % 2, 1.0, -1.0)
    speed = np.zeros(rows)
    for row in range(rows - 1):
        speed[row + 1] = speed[row] + step / 0.1 * (0.9 * drive[row] - speed[row])
    lagging = speed + np.random.default_rng(1).normal(0.0, 0.002, rows)
    table = np.column_stack([step * np.arange(rows), drive, lagging])
    np.savetxt(tmp_path / "train.csv", table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    text = PROJECT.replace("gain = { value = 20.0, free = true }", "gain = { value = 1.0, free = false }")
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    problem = problem_of(tmp_path / "project.toml")
    begin, noises = first_point(problem, problem.train), [white(0.002)]
    bare = fit(problem, problem.train, (), begin, noises, 24)
    found = {}
    for name in ("input_saturation", "sensor_gain", "sensor_lag"):
        term = problem.term(name)
        assert term is not None
        grown = [extended(bare, term, start) for start in problem.starts[term.label]]
        fits = [fit(problem, problem.train, *each, noises, 24) for each in grown]
        found[name] = rated(problem, min(fits, key=lambda each: each.cost))
    limited, scaled = found["input_saturation"], found["sensor_gain"]
    assert abs(limited.score - scaled.score) < TIE
    lag = problem.term("sensor_lag")
    assert lag is not None
    both = extended(limited.fitted, lag, problem.starts[lag.label][0])
    best = rated(problem, fit(problem, problem.train, *both, noises, 24))
    (other,) = retied(problem, best, ((limited, scaled), (best,)))
    assert set(other.fitted.names) == {"sensor_gain", "sensor_lag"} and other.score < best.score + TIE
    assert retied(problem, best, ((limited, found["sensor_lag"]), (best,))) == ()
