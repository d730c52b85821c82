"""Faults planted in the generated C are called `differs`, or shown by z3 to change nothing."""

from __future__ import annotations

import pytest

from bench.equivalence import equivalent
from bench.mutants import Mutant, bench, chosen, example_law, laws, mutants, planted
from bench.zeros import never_minus_zero
from codegen.emit import emit
from quantize.lower import lower


@pytest.mark.parametrize(("name", "arithmetic"), [("full pid", "fixed32"), ("tuned pid", "float32")])
def test_planted_faults_are_found(name: str, arithmetic: str) -> None:
    judge = bench(laws()[name], arithmetic, 40_000, 1)
    found = chosen(mutants(judge.bundle), 14)
    outcomes = [(m, judge.outcome(planted(judge.bundle, m))) for m in found]
    assert len(found) >= 13 and sum(outcome == "differs" for _, outcome in outcomes) >= 8
    missed = [m for m, outcome in outcomes if outcome == "agrees" and equivalent(judge.program, m) is None]
    assert missed == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "arithmetic"), [("full pid", "fixed32"), ("state_feedback", "float32")])
def test_no_fault_that_is_found_is_called_equivalent(name: str, arithmetic: str) -> None:
    judge = bench(laws()[name], arithmetic, 30_000, 1)
    found = mutants(judge.bundle)[::23]
    claimed = [m for m in found if equivalent(judge.program, m) is not None]
    assert len(found) > 5
    assert [m.what for m in claimed if judge.outcome(planted(judge.bundle, m)) == "differs"] == []


def test_a_limit_that_acts_is_not_called_equivalent_when_it_is_moved() -> None:
    judge = bench(example_law(), "fixed32", 30_000, 1)
    line = next(m for m in mutants(judge.bundle) if "output_limited" in m.before and m.what == "limit removed")
    assert equivalent(judge.program, line) is None
    assert equivalent(judge.program, Mutant("nothing", line.line, line.before, line.before)) is not None


def test_a_zero_of_either_sign_is_added_to_what_is_never_minus_zero() -> None:
    program = lower(laws()["state_feedback"], "float64")
    assert "integral" in never_minus_zero(program)
    assert "current_last" not in never_minus_zero(lower(laws()["start_monitor"], "float64"))  # it is an input's value
    found = mutants(emit(program, "firmloop generate x.toml"))
    asked = next(m for m in found if "(error < 0.0)" in m.before and m.what == "< -> <=")
    assert equivalent(program, asked) is not None


def test_another_sample_is_drawn_from_a_seed() -> None:
    found = mutants(emit(lower(example_law(), "float32"), "firmloop generate x.toml"))
    usual, one, other = chosen(found, 12), chosen(found, 12, 1), chosen(found, 12, 2)
    assert one == chosen(found, 12, 1) and len({tuple(map(str, sample)) for sample in (usual, one, other)}) == 3


def test_the_unplanted_code_agrees() -> None:
    judge = bench(example_law(), "fixed16", 40_000, 1)
    assert judge.outcome(judge.bundle) == "agrees"
