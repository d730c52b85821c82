"""An effect stays where it is its own, and is as sure as the surest of the sizes that switch it."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.diagnose.model.candidate import rated
from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, deviations, fit, strength, tethers
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, coordinates, entered, first_point
from firmloop.diagnose.policy import IMPOSSIBLE
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import concealed, problem_of


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    return problem_of(concealed(tmp_path_factory.mktemp("own"), "coulomb_friction", 0.1, False))


def _fitted(problem: Problem, name: str, **values: float) -> tuple[Fitted, LibraryTerm]:
    term = problem.term(name)
    assert term is not None
    begin = first_point(problem, problem.train)
    start = dict(problem.starts[term.label][0]) | {
        key: values[key.rpartition(".")[2]] for key in term.keys if key.rpartition(".")[2] in values
    }
    begin = Point(entered(begin.values, term, start), begin.starts)
    spreads = [float(np.std(problem.train[0].columns[signal.name])) for signal in problem.plant.outputs]
    return fit(problem, problem.train, (term,), begin, [white(1e-3 * each) for each in spreads], 0), term


def test_friction_that_falls_from_rest_never_rises(problem: Problem) -> None:
    fitted, term = _fitted(problem, "stribeck_friction", coulomb_N_m=0.01, static_N_m=0.02)
    unknowns = coordinates(problem, (term,), fitted.point.values)
    squares = SumOfSquares(problem, problem.train, unknowns, fitted.noises, tethers(problem, unknowns))
    place = [each.name for each in unknowns].index("stribeck_friction.static_N_m")
    step = np.zeros(len(unknowns) + len(problem.engine.states) * len(problem.train))
    step[place] = (0.005 - 0.02) / unknowns[place].scale
    moved = squares.moved(fitted.point, step).values
    assert moved["stribeck_friction.static_N_m"] == moved["stribeck_friction.coulomb_N_m"] == 0.01
    step[place] = (0.5 - 0.02) / unknowns[place].scale
    moved = squares.moved(fitted.point, step).values
    assert moved["stribeck_friction.coulomb_N_m"] == pytest.approx(0.1 * moved["stribeck_friction.static_N_m"])


def test_one_direction_without_friction_makes_that_of_the_other_no_less_sure(problem: Problem) -> None:
    sure, term = _fitted(problem, "asymmetric_friction", positive_N_m=0.0, negative_N_m=0.02)
    assert strength(sure, term) > 3.0
    nothing, _ = _fitted(problem, "asymmetric_friction", positive_N_m=0.0, negative_N_m=0.0)
    assert strength(nothing, term) == 0.0


def test_a_gain_of_one_is_nothing(problem: Problem) -> None:
    same, term = _fitted(problem, "sensor_gain", gain=1.0)
    assert strength(same, term) == 0.0
    more, _ = _fitted(problem, "sensor_gain", gain=1.1)
    assert strength(more, term) == pytest.approx(0.1 / deviations(more)[term.keys[0]])


def test_a_shape_of_one_is_not_nothing(problem: Problem) -> None:
    fitted, term = _fitted(problem, "presliding_friction", coulomb_N_m=0.02)
    key = term.keys[0]
    moved = Point({**fitted.point.values, key: term.parameters[0].neutral}, fitted.point.starts)
    same = fit(problem, problem.train, (term,), moved, fitted.noises, 0)
    assert strength(same, term) > 0.0


def test_what_is_strange_once_a_newer_effect_explains_it_goes(problem: Problem) -> None:
    rising, stribeck = _fitted(problem, "stribeck_friction", coulomb_N_m=0.02, static_N_m=0.01)
    friction = problem.term("coulomb_friction")
    assert friction is not None
    begin = Point({**rising.point.values, friction.keys[0]: 0.02}, rising.point.starts)
    older = fit(problem, problem.train, (stribeck, friction), begin, rising.noises, 0)
    newest = fit(problem, problem.train, (friction, stribeck), begin, rising.noises, 0)
    assert rated(problem, older).fitted.names == ("coulomb_friction",)
    assert rated(problem, older).score < rated(problem, newest).score == IMPOSSIBLE
