"""A second inertia is taken from the nominal one, and goes back to it with the effect that had it."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.diagnose.model.candidate import extended, without
from firmloop.diagnose.model.fit import Fitted, fit
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, first_point
from firmloop.diagnose.search.exchange import exchanged
from firmloop.identify.fitting.noise import white
from tests.diagnose.cases import drawn, problem_of

SEED = 891157  # a stage of one mass
LOAD = 7.0


@pytest.fixture
def problem(tmp_path: Path) -> Problem:
    return problem_of(drawn(tmp_path, SEED))


def term_of(problem: Problem, name: str) -> LibraryTerm:
    found = problem.term(name)
    assert found is not None
    return found


def loaded(problem: Problem, term: LibraryTerm, load: float) -> dict[str, float]:
    """Return the first start of a term with a second mass of `load` kg."""
    return {**problem.starts[term.label][0], f"{term.label}.load_mass_kg": load}


def coupled(problem: Problem) -> tuple[Fitted, float]:
    """Return the stage with a load on a coupling, and its mass before."""
    coupling, begin = term_of(problem, "flexible_coupling"), first_point(problem, problem.train)
    values = entered(begin.values, coupling, loaded(problem, coupling, LOAD))
    sizes = [white(1.0)] * len(problem.plant.outputs)
    made = fit(problem, problem.train, (coupling,), Point(values, begin.starts), sizes, 0)
    assert made.point.values["mass_kg"] == pytest.approx(begin.values["mass_kg"] - LOAD, rel=1e-12)
    return made, begin.values["mass_kg"]


def test_a_load_that_is_left_out_is_mass_again(problem: Problem) -> None:
    base, mass = coupled(problem)
    terms, point = without(base, *base.terms)
    assert not terms
    assert point.values["mass_kg"] == pytest.approx(mass, rel=1e-12)


def test_a_gap_that_contains_a_coupling_adds_no_mass_and_loses_none(problem: Problem) -> None:
    base, mass = coupled(problem)
    gap = term_of(problem, "backlash")
    terms, point = extended(base, gap, loaded(problem, gap, LOAD / 2))
    assert terms == (gap,)
    assert point.values["mass_kg"] + point.values[f"{gap.label}.load_mass_kg"] == pytest.approx(mass, rel=1e-12)


def test_a_gap_with_the_same_load_leaves_the_mass_exactly_as_it_was(problem: Problem) -> None:
    base, _ = coupled(problem)
    gap = term_of(problem, "backlash")
    _, point = exchanged(base, base.terms[0], gap, loaded(problem, gap, LOAD))
    assert point.values["mass_kg"] == base.point.values["mass_kg"]
