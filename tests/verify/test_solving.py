"""The compiled search of a quadratic program finds what its twin in Python finds, in every bit."""

from dataclasses import replace

import numpy as np
import pytest

from bench.mpc.random_problems import law_of as random_problem
from firmloop.design.law import DesignError, Law
from firmloop.design.outcome import CAPPED, INFEASIBLE, SOLVED
from firmloop.design.quadratic.region import drawn_parameters
from firmloop.quantize.formats.quadratic import rows_of, table_of
from firmloop.quantize.twins.qp import Raw, Rows, exact, solve
from firmloop.verify.lanes.compiled import Compiled, library
from firmloop.verify.lanes.programs import Solving
from tests.quantize.test_quadratic import CASES, HARD, LARGE, law_of


def same(rows: Rows, parameters: Raw) -> set[int]:
    """Compare moves and status of both; return which status there were."""
    code, (lanes, width), kind = library(), parameters.shape, rows.gram.dtype
    assert code is not None
    solving = Solving(rows, tuple(range(width)), width)
    ready = Compiled(code, kind, [solving], {}, range(width), (), (), range(width, solving.end + 1))
    found = ready.results(np.ascontiguousarray(parameters.T, kind)[None], np.empty((0, lanes), kind))[0]
    expected = solve(rows, parameters.astype(kind))
    np.testing.assert_array_equal(found[-1], expected.status)
    bits = f"u{kind.itemsize}"
    np.testing.assert_array_equal(np.ascontiguousarray(found[:-1].T).view(bits), expected.moves.view(bits))
    return set(expected.status.tolist())


def rounded(law: Law, arithmetic: str, budget: int, checked: bool) -> Rows:
    assert law.solve is not None
    return rows_of(table_of(law.solve.quadratic, arithmetic, "plan", budget, checked), np.dtype(arithmetic))


@pytest.mark.parametrize("checked", [False, True])
@pytest.mark.parametrize("case", LARGE)
def test_a_search_whose_answers_are_refined_finds_the_same(case: str, checked: bool) -> None:
    inputs, keys = LARGE[case]
    law = law_of(inputs, **keys)
    parameters, told = drawn_parameters(law, 30, 2)[:200], set()
    for arithmetic in ("float32", "float64"):
        for budget in (400, 10**4):
            told |= same(rounded(law, arithmetic, budget, checked), parameters)
    assert told >= {SOLVED, CAPPED}


@pytest.mark.parametrize("many", [False, True])
def test_a_search_that_keeps_a_factor_and_one_that_keeps_a_tableau_find_the_same(many: bool) -> None:
    law, told = law_of(CASES["hard limits"][0], **HARD), set()
    parameters = drawn_parameters(law, 300, 3)[:1000]
    parameters[3, 0], parameters[5, 1], parameters[7] = np.nan, np.inf, 1e30
    for arithmetic in ("float32", "float64"):
        for budget in (60, 10**4):
            told |= same(replace(rounded(law, arithmetic, budget, False), many=many), parameters)
    assert told == {SOLVED, CAPPED, INFEASIBLE}


@pytest.mark.parametrize("seed", range(4000, 4010))
def test_random_problems_end_the_same(seed: int) -> None:
    try:
        _, law = random_problem(seed)
    except DesignError:
        pytest.skip("its design refuses it")
    assert law.solve is not None
    parameters = drawn_parameters(law, 50, seed)[:100]
    same(exact(law.solve.quadratic), parameters)
    for checked in (False, True):
        same(rounded(law, "float32", 2000, checked), parameters)
