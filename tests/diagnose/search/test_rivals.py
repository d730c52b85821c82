"""What innovations hardly tell apart is told by what was left out of the fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from firmloop.diagnose.model.candidate import Candidate, extended, rated
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.policy import TIE
from firmloop.diagnose.search import held_out
from firmloop.diagnose.search.found import Search, candidates_of, standing
from firmloop.diagnose.search.harmless import Simulations, as_identified
from firmloop.diagnose.search.held_out import Kept, holding
from firmloop.diagnose.search.simulation_error import misfits
from firmloop.identify.plants.effects import find_effect
from tests.diagnose.cases import concealed, nominal_of, problem_of, refitted, shortened, without_tests

WRONG, RIGHT = "return_spring", "coulomb_friction"


def _tried(problem: Problem, nominal: Candidate, name: str) -> Candidate:
    term = problem.term(name)
    assert term is not None
    _, begin = extended(nominal.fitted, term, problem.starts[term.label][0])
    fitted, _ = refitted(problem, term, begin, [noise.rms for noise in nominal.noises])
    return rated(problem, fitted)


def _called_otherwise(candidate: Candidate) -> Candidate:
    """Return what does just the same by another name."""
    (term,) = candidate.fitted.terms
    return replace(candidate, fitted=replace(candidate.fitted, terms=(replace(term, effect=find_effect(WRONG)),)))


def _plain(problem: Problem) -> Simulations:
    refit = as_identified(problem.plant, problem.train)
    assert refit is not None
    return Simulations(refit, problem.train)


@pytest.mark.parametrize("behind", [5.0, 500.0])
def test_what_holds_where_it_was_left_out_stands_for_what_innovations_prefer_by_little(
    behind: float, tmp_path: Path
) -> None:
    problem = problem_of(shortened(without_tests(concealed(tmp_path, RIGHT, 0.3, False))))
    nominal = nominal_of(problem)
    wrong, right = (_tried(problem, nominal, name) for name in (WRONG, RIGHT))
    wrong = replace(wrong, score=right.score - behind)
    found = Search(problem, nominal, wrong, ((wrong, right),), (), (nominal.score - wrong.score,))
    kept = holding(found, _plain(problem))
    if behind > 100.0:
        assert kept.search is None
        return
    assert kept.search is not None and kept.search.best.fitted.names == (RIGHT,)
    assert [each.fitted.names for turn in kept.search.rounds for each in turn] == [(RIGHT,)]


@pytest.mark.parametrize("off", [1.1, 5.0])
def test_the_best_stands_beside_its_rival_where_it_comes_about_as_near(
    off: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lag and a slew rate after one step: a drift alone makes the one a hair worse where it was left out."""
    problem = problem_of(shortened(without_tests(concealed(tmp_path, RIGHT, 0.3, False))))
    nominal = nominal_of(problem)
    best, rival = (_tried(problem, nominal, name) for name in (WRONG, RIGHT))
    best = replace(best, score=rival.score - 5.0)
    found = Search(problem, nominal, best, ((best, rival),), (), (nominal.score - best.score,))

    def kept(search: Search, bench: object) -> Kept:
        holds = search.best.fitted.names == (RIGHT,)
        return Kept(search if holds else None, {"speed": {"after": 1.0 if holds else off, "refit": 1.0}}, holds)

    monkeypatch.setattr(held_out, "_kept", kept)
    monkeypatch.setattr(held_out, "likely", lambda fitted: True)
    made = holding(found, _plain(problem)).search
    assert made is not None and made.best.fitted.names == (RIGHT,)
    names = {each.fitted.names for turn in made.rounds for each in turn}
    assert names == ({(RIGHT,), (WRONG,)} if off < 2.0 else {(RIGHT,)})


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_what_is_preferred_by_little_of_all_that_is_explained_gives_way_too(share: float, tmp_path: Path) -> None:
    """Little beside all that is explained: where far more is told by another, what holds is not the whole of it."""
    problem = problem_of(shortened(without_tests(concealed(tmp_path, RIGHT, 0.3, False))))
    nominal = nominal_of(problem)
    wrong, right = (_tried(problem, nominal, name) for name in (WRONG, RIGHT))
    explained = nominal.score - right.score
    wrong = replace(wrong, score=right.score - share / (1.0 - share) * explained)
    found = Search(problem, nominal, wrong, ((wrong, right),), (), (nominal.score - wrong.score,))
    kept = holding(found, _plain(problem))
    if share > 0.25:
        assert kept.search is None
        return
    assert kept.search is not None and kept.search.best.fitted.names == (RIGHT,)
    assert [each.fitted.names for turn in kept.search.rounds for each in turn] == [(RIGHT,)]


def test_what_innovations_prefer_gives_way_where_the_input_explains_what_it_leaves(tmp_path: Path) -> None:
    problem = problem_of(without_tests(concealed(tmp_path, RIGHT, 1.0, False)))
    nominal, plain = nominal_of(problem), _plain(problem)
    lag, right = (_tried(problem, nominal, name) for name in ("sensor_lag", RIGHT))
    likelier = replace(lag, score=right.score - 500.0)
    found = Search(problem, nominal, likelier, ((likelier, right),), (), (1.0,), plain.plant)
    assert misfits(found)
    kept = holding(found, plain).search
    assert kept is not None and kept.best.fitted.names == (RIGHT,)
    assert kept.rounds[-1] == () or kept.rounds[-1][0].score > kept.best.score + TIE


def test_what_was_fitted_from_several_starts_is_one_explanation(tmp_path: Path) -> None:
    """Counted once a start, a runner-up had left less than half of the probability to what is right."""
    problem = problem_of(shortened(without_tests(concealed(tmp_path, RIGHT, 0.3, False))))
    nominal = nominal_of(problem)
    right = _tried(problem, nominal, RIGHT)
    as_near = _called_otherwise(right)
    behind = [replace(as_near, score=right.score + each) for each in (11.0, 12.0, 13.0)]
    found = Search(problem, nominal, right, (tuple(behind), (right,)), (), (nominal.score - right.score,))
    for beside in (standing(found), candidates_of(found)):
        assert [each.score for each in beside] == [right.score + 11.0]


@pytest.mark.parametrize(("share", "beside"), [(1.0, 1), (1e-9, 0)])
def test_what_is_as_likely_nothing_by_its_own_interval_stands_beside_no_explanation(
    share: float, beside: int, tmp_path: Path
) -> None:
    problem = problem_of(shortened(without_tests(concealed(tmp_path, RIGHT, 0.3, False))))
    nominal = nominal_of(problem)
    right = _tried(problem, nominal, RIGHT)
    near = _called_otherwise(right)
    unsure = replace(near, fitted=replace(near.fitted, normal=share * near.fitted.normal), score=right.score + 5.0)
    found = Search(problem, nominal, right, ((right, unsure),), (), (nominal.score - right.score,))
    assert len(standing(found)) == beside
