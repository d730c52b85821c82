"""A screen tells what a term changes, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import single_case
from firmloop.diagnose.model.candidate import extended
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Point, entered, first_point
from firmloop.diagnose.search.round import _sized, screened
from firmloop.diagnose.search.screen import Order, _promising, secants
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import BY_NAME, concealed, lagged, logged, nominal_of, problem_of, truths, written

FLOW = """schema = 1
name = "flow"
[recordings]
train = ["log.csv"]
[plant]
kind = "ode"
states = ["LEVEL"]
inputs = ["drive_pct"]
[plant.outputs]
LEVEL = "LEVEL"
[plant.derivatives]
LEVEL = "(gain*drive_pct - LEVEL)/lag_s"
[plant.balances]
LEVEL = { kind = "flow", per = "1/lag_s" }
[plant.parameters]
gain = { value = 1.0, free = true }
lag_s = { value = 20.0, free = true }
"""


def test_beside_a_slow_clock_a_limit_that_is_never_met_changes_nothing(tmp_path: Path) -> None:
    """The last rows are read after the input has ended, so that no simulation is held against them."""
    problem = problem_of(concealed(tmp_path, "clock_skew", 1.0, False))
    skew, limit = problem.term("clock_skew"), problem.term("sensor_saturation")
    assert skew is not None and limit is not None
    begin = first_point(problem, problem.train)
    late = Point(entered(begin.values, skew, {skew.keys[0]: 0.002}), begin.starts)
    base = fit(problem, problem.train, (skew,), late, [white(1.0) for _ in problem.plant.outputs], 0)
    far = {key: 1e6 for key in limit.keys}
    for traces in secants(problem, problem.train, base, limit, far):
        assert all(np.all(np.abs(trace) < 1e-9) for trace in traces)


def test_a_motor_driven_a_hundred_times_as_hard_as_it_cogs_shows_how_often_it_does(tmp_path: Path) -> None:
    """A wave as large as what moves the motor carries it past its own crests, and looks like another."""
    case = single_case(0, "cogging_torque", BY_NAME["gear_motor"], ("position", "current"), "prbs", False, 0.03)
    whole = problem_of(written(tmp_path, case))
    term = whole.term("cogging_torque")
    assert term is not None
    large = tuple({**start, term.keys[0]: 0.1} for start in whole.starts[term.label])
    problem = replace(whole, starts={**whole.starts, term.label: large})
    problem.engine.follow(False)
    nominal = nominal_of(problem)
    best = screened(problem, nominal)[0]
    truth = truths(tmp_path, "cogging_torque")
    assert best.term is term
    assert best.start["cogging_torque.periods_per_rev"] == truth["periods_per_rev"]
    assert best.start["cogging_torque.amplitude_N_m"] == pytest.approx(truth["amplitude"], rel=0.2)


@pytest.mark.parametrize(("times", "halved"), [(1.0, False), (8.0, True)])
def test_a_wave_that_begins_past_its_own_crests_begins_smaller_too(times: float, halved: bool, tmp_path: Path) -> None:
    case = single_case(5, "torque_ripple", BY_NAME["flat_motor"], ("position", "current"), "chirp", False, 0.3)
    problem = problem_of(written(tmp_path, case))
    nominal, term = nominal_of(problem), problem.term("torque_ripple")
    assert term is not None
    told = truths(tmp_path, "torque_ripple")
    start = {key: told[next(name for name in told if name in key)] for key in term.keys}
    size = term.keys[0]
    terms, begin = extended(nominal.fitted, term, {**start, size: times * start[size]})
    found = _sized(problem, nominal, terms, begin)
    assert bool(found) is halved
    for _, point in found:
        costs = [
            fit(problem, problem.train, *each, nominal.noises, 0).cost for each in ((terms, point), (terms, begin))
        ]
        assert costs[0] < nominal.fitted.cost < costs[1]


def test_a_weight_begins_as_large_as_a_wave_once_a_turn_seems(tmp_path: Path) -> None:
    """One that begins larger carries the shaft past its own crest, and looks like another."""
    problem = problem_of(concealed(tmp_path, "", 0.3, False))
    term = problem.term("gravity_torque")
    assert term is not None
    starts = problem.starts[term.label]
    size, phase = term.keys
    (begin,) = _promising(term, starts, (Order(1.0, 0.1 * starts[0][size]),))
    assert begin == {size: pytest.approx(0.1 * starts[0][size]), phase: starts[0][phase]}
    assert _promising(term, starts, ()) == [starts[0]]


@pytest.mark.parametrize(("level", "runs_over"), [("warm_C", False), ("level_m", True)])
def test_a_level_may_run_over_and_heat_may_not(tmp_path: Path, level: str, runs_over: bool) -> None:
    drive = np.repeat([0.0, 40.0, 10.0, 60.0], 50)
    head = f"time_s,drive_pct,{level}"
    project = logged(tmp_path, FLOW.replace("LEVEL", level), head, np.arange(200.0), drive, lagged(drive, 0.2))
    assert (problem_of(project).term("overflow") is not None) == runs_over
