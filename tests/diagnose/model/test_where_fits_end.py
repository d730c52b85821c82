"""Where fits end: on the scale of torques as given, with inertias split, past contacts, in honest intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.diagnose.blind_cases import draw_case
from firmloop.diagnose.model import kinks
from firmloop.diagnose.model.continuation import grown
from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, fit, noises_of, tethers
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, coordinates, entered, first_point
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.model.torque_scale import near_given
from firmloop.diagnose.search.exchange import exchanged
from firmloop.diagnose.search.from_given import runaways
from firmloop.identify.fitting.noise import white
from firmloop.identify.fitting.problem import FitPoint, FitProblem
from firmloop.identify.plants.effects import find_effect
from tests.diagnose.cases import drawn, problem_of, said_of

TORQUES = ("kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")


def test_torques_keep_the_scale_that_is_given(tmp_path: Path) -> None:
    problem = problem_of(drawn(tmp_path, 470089))
    begin = first_point(problem, problem.train)
    unknowns = coordinates(problem, (), begin.values)
    noises = [white(float(np.std(problem.train[0].columns[signal.name]))) for signal in problem.plant.outputs]
    squares = SumOfSquares(problem, problem.train, unknowns, noises, tethers(problem, unknowns))
    place = near_given(squares, squares.at(begin))
    away = squares.at(
        replace(place.point, values={**place.point.values, **{k: 1.3 * place.point.values[k] for k in TORQUES}})
    )
    assert away.cost == pytest.approx(place.cost, rel=1e-6)
    back = near_given(squares, away)
    assert back.whole < away.whole
    for key in TORQUES:
        assert back.point.values[key] == pytest.approx(place.point.values[key], rel=1e-3)


def test_a_simulation_that_has_diverged_costs_most(tmp_path: Path) -> None:
    """However fine a sensor, what is a million times its noise away is nearer than what is nowhere."""
    problem = problem_of(drawn(tmp_path, 470089))
    begin = first_point(problem, problem.train)
    spreads = [float(np.std(problem.train[0].columns[signal.name])) for signal in problem.plant.outputs]
    squares = SumOfSquares(problem, problem.train, (), [white(1e-6 * each) for each in spreads], np.zeros((0, 1)))
    here, gone = squares.at(begin), squares.at(replace(begin, values={**begin.values, "b_N_m_s_rad": -1e3}))
    assert here.finite and not gone.finite
    assert here.cost < gone.cost


@pytest.mark.parametrize(("share", "away"), [(0.5, False), (0.2, True)])
def test_an_inertia_that_was_split_has_not_run_away(share: float, away: bool, tmp_path: Path) -> None:
    problem = problem_of(drawn(tmp_path, 470076))
    term, begin = problem.term("flexible_coupling"), first_point(problem, problem.train)
    assert term is not None and term.taken is not None
    load, held = term.taken
    given = begin.values[held]
    start = {**problem.starts[term.label][0], load: 0.5 * given}
    values = {**entered(begin.values, term, start), held: share * given - (0.1 * given if away else 0.0)}
    fitted = Fitted((term,), (), Point(values, begin.starts), (), 0.0, (), np.zeros((0, 0)))
    assert (held in runaways(problem, fitted)) is away


@pytest.mark.parametrize(("share", "carried"), [(1e9, False), (0.5, True)])
def test_a_load_too_large_to_move_is_not_carried_by_what_comes_in_its_place(
    share: float, carried: bool, tmp_path: Path
) -> None:
    problem = problem_of(drawn(tmp_path, 470076))
    coupling, spring, begin = (
        problem.term("flexible_coupling"),
        problem.term("return_spring"),
        first_point(problem, problem.train),
    )
    assert coupling is not None and spring is not None and coupling.taken is not None
    load, held = coupling.taken
    given = begin.values[held]
    start = {**problem.starts[coupling.label][0], load: share * given}
    values = {**entered(begin.values, coupling, start), held: given}
    fitted = Fitted((coupling,), (), Point(values, begin.starts), (), 0.0, (), np.zeros((0, 0)))
    _, point = exchanged(fitted, coupling, spring, problem.starts[spring.label][0])
    assert point.values[held] == pytest.approx(given * (1.0 + share if carried else 1.0))


@pytest.mark.parametrize(
    ("name", "values", "simpler"),
    [
        pytest.param("asymmetric_friction", (1.0, 1.02), "coulomb_friction", id="alike in both directions"),
        pytest.param("asymmetric_friction", (1.0, 1.2), "", id="not alike"),
        pytest.param("flexible_coupling", (5e-3, 10.0, 0.0), "return_spring", id="to what is too large to move"),
        pytest.param("flexible_coupling", (5e-3, 1e-3, 0.0), "", id="to what moves"),
    ],
)
def test_an_effect_whose_values_amount_to_a_simpler_one_is_that(
    name: str, values: tuple[float, ...], simpler: str, tmp_path: Path
) -> None:
    becomes, term = find_effect(name).becomes, problem_of(drawn(tmp_path, 470076)).term(name)
    assert becomes is not None and term is not None
    assert becomes(values, term.scales) == simpler


@pytest.mark.parametrize(
    ("stiffness", "pushes"),
    [pytest.param(0.0, True, id="as hard as usual"), (1e6, True), pytest.param(1e-200, False, id="no flank at all")],
)
def test_a_gap_whose_flanks_never_push_is_none(stiffness: float, pushes: bool, tmp_path: Path) -> None:
    believable, term = find_effect("backlash").believable, problem_of(drawn(tmp_path, 470076)).term("backlash")
    assert believable is not None and term is not None
    assert believable((0.1, term.scales.inertia, stiffness, 1e-3), term.scales) is pushes


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(490063, id="a load beside a slow disturbance"),
        pytest.param(470076, id="a coupling in a curved valley", marks=pytest.mark.slow),
        pytest.param(490014, id="a gap that a position shows to a fiftieth", marks=pytest.mark.slow),
    ],
)
def test_intervals_hold_what_is_true(seed: int, tmp_path: Path) -> None:
    (hidden,) = draw_case(seed).hidden
    (effect,) = said_of(drawn(tmp_path, seed))["effects"]
    assert effect["name"] == hidden.name
    (true,) = list(hidden.told.values())[:1]
    low, high = next(iter(effect["parameters"].values()))["ci95"]
    assert low <= true <= high


def with_backlash(problem: Problem, seed: int) -> tuple[LibraryTerm, Point]:
    """Return the term and the point at which the case was made."""
    case = draw_case(seed)
    (hidden,) = case.hidden
    term, begin = problem.term("backlash"), first_point(problem, problem.train)
    assert term is not None
    words = ("gap", "coupled_inertia", "coupling", "coupling_damping")
    true = {key: float(hidden.truth[word]) for key, word in zip(term.keys, words, strict=True)}
    plant = {"mass_kg": case.machine.values["J"], "b_N_s_m": case.machine.values["b"]}
    return term, Point({**begin.values, **plant, **true}, begin.starts)


def test_bodies_meet_at_the_same_moment_whatever_the_steps(tmp_path: Path) -> None:
    problem = problem_of(drawn(tmp_path, 490007))
    _, point = with_backlash(problem, 490007)
    fine, coarse = (
        (problem.engine.hasten(steps), problem.engine.simulate(problem.train[0], point.values, point.starts[0]))[1]
        for steps in (0.03, 1.0)
    )
    assert float(np.std(coarse - fine)) < 1e-6  # m, of a stage that moves 0.1 m and more


def test_a_stretch_that_grows_leads_to_a_gap(tmp_path: Path) -> None:
    problem = problem_of(drawn(tmp_path, 680002))
    term, true = with_backlash(problem, 680002)
    gap = term.keys[0]
    wide = next(start for start in problem.starts[term.label] if start[gap] > 0.3 * true.values[gap])
    away = Point({**true.values, **wide}, true.starts)
    begun = fit(problem, problem.train, (term,), away, [white(0.02)], 12)
    found = grown(problem, begun, noises_of(problem, begun.residuals))
    assert abs(begun.point.values[gap] / true.values[gap] - 1.0) > 0.1
    assert found.point.values[gap] == pytest.approx(true.values[gap], rel=0.01)


def test_no_simulation_of_a_last_fit_takes_far_longer_than_where_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of teeth as hard as a search may leave them, one simulation went on for a quarter of an hour."""
    problem = problem_of(drawn(tmp_path, 470089))
    noises = [white(1.0) for _ in problem.plant.outputs]
    fitted = fit(problem, problem.train, (), first_point(problem, problem.train), noises, 0)
    begun = problem.engine.steps
    residual_of(problem, problem.train[0], fitted.point, 0)
    alone = 1e6 * (problem.engine.steps - begun)
    most: list[float] = []

    def solve(asked: FitProblem, place: FitPoint, steps: int) -> tuple[FitPoint, float]:
        most.extend(made.course.most_steps for made in asked.experiments)
        return place, 0.0

    monkeypatch.setattr(kinks, "solve", solve)
    kinks.polished(problem, fitted, noises)
    assert 2.0 * alone < most[0] < 100.0 * alone
