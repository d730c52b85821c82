"""What is written simulates no worse than a plain refit, and test recordings choose nothing of it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case, single_case
from firmloop.diagnose.model.candidate import believable, on_bound
from firmloop.diagnose.model.fit import Fitted, fit
from firmloop.diagnose.model.hypothesis import Problem, first_point, rescaled
from firmloop.diagnose.search.harmless import Simulations, by_simulation_error, harmless, no_worse
from firmloop.identify.fitting.noise import white
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.conftest import Once
from tests.diagnose.cases import (
    BY_NAME,
    concealed,
    concealed_once,
    drawn,
    problem_of,
    said_of,
    said_once,
    shortened,
    without_tests,
    written,
)

AT_REST = "240033"  # the seed of a case with dry friction whose test recording shows a peak at rest, and train does not


def _alone(problem: Problem) -> Fitted:
    begin = first_point(problem, problem.train)
    return by_simulation_error(
        problem, fit(problem, problem.train, (), begin, [white(1.0)] * len(problem.plant.outputs), 12)
    )


def test_without_its_test_recording_a_project_gets_the_same_verdict_and_values(once: Once, tmp_path: Path) -> None:
    whole = said_once(once, AT_REST, draw_case(int(AT_REST)))
    bare = said_of(without_tests(drawn(tmp_path, int(AT_REST))))
    assert "test" in whole["fit"] and "test" not in bare["fit"]
    for key in ("verdict", "effects", "alternatives", "shifts", "noise", "whiteness", "location"):
        assert whole[key] == bare[key]
    assert whole["simulation_rms"]["train"] == bare["simulation_rms"]["train"]


@pytest.mark.parametrize(("name", "colored"), [("", False), ("coulomb_friction", True)])
def test_what_is_written_simulates_no_worse_than_the_refit(name: str, colored: bool, once: Once) -> None:
    said = concealed_once(once, name, colored).said
    for plants in said["simulation_rms"]["train"].values():
        assert plants["after"] <= 1.01 * plants["refit"]
        assert bool(name) == (plants["after"] < 0.99 * plants["refit"]) or plants["refit"] < 1.05 * plants["after"]


def test_a_plant_that_is_off_is_not_harmless(tmp_path: Path) -> None:
    project = read_project(concealed(tmp_path, "", 0.3, False))
    plant, train = plant_of(project), read_data(project).train
    off = replace(plant, parameters=tuple(replace(p, value=1.3 * p.value) for p in plant.parameters))
    right, wrong = (Simulations(each, train) for each in (plant, off))
    assert harmless(right, right)
    assert not harmless(wrong, right) or not harmless(right, wrong)


def test_the_noise_of_the_first_reading_tells_no_better_plant() -> None:
    true, off, wrong = (
        make_plant("rotary_stage", ("torque_N_m",), ["position_rad"], {"J_kg_m2": 0.01, "b_N_m_s_rad": friction})
        for friction in (0.1, 0.1001, 0.101)
    )
    time, noise = np.arange(600) * 0.01, np.random.default_rng(5).normal(size=600) * 1e-3
    driven = {"torque_N_m": 0.1 * (time < 1.0), "position_rad": 0.0 * time}
    noise[0] = 1e-3  # by which all that begins there is too high, and the drift of the wrong plant too low
    driven["position_rad"] = simulate(true, make_recording(time, driven, "bare.csv", ""), None)[:, 0] + noise
    seen = [make_recording(time, driven, "log.csv", "")]
    made = {"true": Simulations(true, seen), "off": Simulations(off, seen), "wrong": Simulations(wrong, seen)}
    assert made["true"].rms() > 1.3 * made["off"].rms()
    rms = {name: each.from_starts() for name, each in made.items()}
    assert no_worse(rms["true"], rms["off"]) and not no_worse(rms["off"], rms["true"])
    assert not no_worse(rms["wrong"], rms["true"])
    either = harmless(made["true"], made["off"]), harmless(made["off"], made["true"])
    assert either == (False, False)  # where it begins there all the same


def test_a_value_on_its_bound_is_no_explanation(tmp_path: Path) -> None:
    problem = problem_of(concealed(tmp_path, "coulomb_friction", 0.3, False))
    term = problem.term("eccentric_encoder") or problem.term("sensor_lag")
    assert term is not None
    start = dict(problem.starts[term.label][0])
    begin = first_point(problem, problem.train)
    inside = replace(begin, values={**begin.values, **start})
    fitted = fit(problem, problem.train, (term,), inside, [white(1.0)] * len(problem.plant.outputs), 0)
    ended = {**inside.values, term.keys[0]: term.parameters[0].low}
    assert not on_bound(fitted, term)
    assert not believable(replace(fitted, point=replace(inside, values=ended)))


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("input_delay", 0.01, True),
        ("input_delay", 4.99, False),
        ("sensor_delay", 4.99, False),
        ("slew_rate_limit", 50.0, True),
        ("slew_rate_limit", 2.4e-17, False),  # as a fit of a motor had ended whose spring and friction were missing
        ("clock_skew", 0.08, False),
    ],
)
def test_what_takes_the_input_away_for_the_whole_recording_is_no_explanation(
    name: str, value: float, told: bool, tmp_path: Path
) -> None:
    problem = problem_of(concealed(tmp_path, "", 0.3, False))  # of five seconds
    term = problem.term(name)
    assert term is not None
    begin = first_point(problem, problem.train)
    placed = replace(begin, values={**begin.values, term.keys[0]: value})
    fitted = fit(problem, problem.train, (term,), placed, [white(1.0)] * len(problem.plant.outputs), 0)
    assert believable(fitted) is told


def test_a_limit_at_which_readings_rest_is_not_on_a_bound(tmp_path: Path) -> None:
    problem = problem_of(concealed(tmp_path, "", 0.3, False))
    term = problem.term("sensor_saturation")
    assert term is not None
    (known,) = term.parameters
    rested = replace(term, parameters=(replace(known, low=0.9 * known.high),))  # as where readings rest to a digit
    for place in (0.9 * known.high, known.high / 1.001):  # the lowest that it may be, and the largest reading
        ended = {**first_point(problem, problem.train).values, term.keys[0]: place}
        begin = replace(first_point(problem, problem.train), values=ended)
        fitted = fit(problem, problem.train, (rested,), begin, [white(1.0)] * len(problem.plant.outputs), 0)
        assert fitted.point.values[term.keys[0]] == place
        assert not on_bound(fitted, rested)


def test_no_fit_begins_twice_from_one_place(tmp_path: Path) -> None:
    problem = problem_of(concealed(tmp_path, "", 0.3, False))
    known = {p.name: 2.0 * p.value for p in problem.plant.parameters}
    for starts in rescaled(problem, known).starts.values():
        assert all(start not in starts[:k] for k, start in enumerate(starts))


def test_a_ripple_whose_angle_nobody_reads_is_named_and_the_project_stays_the_refit(tmp_path: Path) -> None:
    """From a start that readings tell the rotor slips a crest; from a fitted one what was left out is foreseen."""
    motor = single_case(10, "torque_ripple", BY_NAME["small_motor"], ("speed", "current"), "prbs", False, 1.0)
    said = said_of(without_tests(shortened(written(tmp_path, motor), 1200)))
    assert (said["verdict"], [each["name"] for each in said["effects"]]) == ("explained", ["torque_ripple"])
    stays = next(line for line in said["says"] if line.startswith("The written project is the plain refit"))
    figures = re.findall(r"_\w+ by ([\d.e-]+) \S+ rms (?:from rest|begun .*?), the refit by ([\d.e-]+) ", stays)
    assert figures and all(float(ours) > float(refit) for ours, refit in figures), stays
    for figures in said["simulation_rms"]["train"].values():
        assert figures["after"] == figures["refit"]
    for figures in said["simulation_rms"]["cross"].values():
        assert figures["after"] < figures["refit"]
