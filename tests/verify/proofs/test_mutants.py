"""Faults planted in the generated C are called `differs`, or shown by z3 to change nothing."""

from __future__ import annotations

import numpy as np
import pytest

from bench.codegen.example_laws import example_law, laws
from bench.proofs.boxes import stays_within
from bench.proofs.equivalence import _where_apart, equivalent
from bench.proofs.finite import only_asked_whether_finite
from bench.proofs.meaning import Meaning
from bench.proofs.mutants import bench
from bench.proofs.orbit import away_from_zero
from bench.proofs.planting import Mutant, chosen, mutants, planted
from bench.proofs.zeros import never_minus_zero
from firmloop.codegen.emit import emit
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program


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


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
def test_draws_are_shown_never_to_be_zero(arithmetic: str) -> None:
    assert away_from_zero(lower(laws()["start_monitor"], arithmetic)) == {"draw": (-1.0, 1.0)}  # they are odd
    assert away_from_zero(lower(laws()["full pid"], arithmetic)) == {}


def test_what_a_line_is_made_into_is_not_taken_to_stay_the_same() -> None:
    program = lower(laws()["self_tuning"], "fixed32")
    limited = next(op for op in program.body if op.result.name == "p12_new").arguments[0]
    low = next(op for op in program.body if op.result.name == limited)
    meaning = Meaning(program)
    meaning.symbol("p12_new")  # where the lower limit acts it has one value, but not in the mutant
    value, limit = low.arguments
    old, new = (meaning.value(f"fl_max_i32({value}, {x})", {}) for x in (limit, int(limit) - 1))
    assert all("p12_new" not in case for pair in _where_apart(meaning, str(limited), old, new) for case in pair)


def test_the_sign_of_a_product_keeps_a_variance_within_its_limit() -> None:
    program = lower(laws()["self_tuning"], "fixed32")
    store = next(op for op in program.body if op.result.name == "p11_new")
    deep = Meaning(program, {})
    assert deep.holds(deep.symbol(str(store.arguments[0])) <= int(store.arguments[1]))


def test_a_limit_of_a_law_in_floating_point_is_taken_to_act() -> None:
    program = lower(laws()["nmpc"], "float32")
    limited = next(op for op in program.body if op.result.name == "plan_x_1_1_new")
    assert limited.function == "clamp" and Meaning(program).ranges[str(limited.arguments[0])] == (-np.inf, np.inf)


def test_a_sum_of_which_is_only_asked_whether_it_is_finite() -> None:
    program = lower(laws()["self_tuning"], "float64")
    writers = {op.result.name: op for op in program.body}
    last = next(op for op in program.body if op.function == "lost").arguments[0]
    chain = [str(last)]
    while writers[chain[-1]].function == "add":
        chain.append(str(writers[chain[-1]].arguments[0]))
    first = writers[chain[-2]]
    limited, other = map(str, first.arguments)
    assert only_asked_whether_finite(program, first.result.name, f"{limited} - {other}")
    assert not only_asked_whether_finite(program, first.result.name, f"{limited} + in->measurement")
    assert not only_asked_whether_finite(program, first.result.name, f"{limited} * 1e308 * 10.0")
    assert not only_asked_whether_finite(program, limited, other)  # it is kept besides
    solved = lower(laws()["mpc"], "float32")  # whose move may be no number, with either sign
    guarded = next(op for op in solved.body if op.result.name in _asked(solved))
    one, other = (str(a).replace("self.", "self->") for a in guarded.arguments)
    assert only_asked_whether_finite(solved, guarded.result.name, f"{one} - {other}")
    assert not only_asked_whether_finite(solved, guarded.result.name, f"{one} - {one}")


def _asked(program: Program) -> set[object]:
    return {op.arguments[0] for op in program.body if op.function == "lost"}


def test_a_limit_that_a_product_of_two_values_never_reaches() -> None:
    """An estimate x of 1 / b is brought nearer by x (2 - b x), which is 1 / b at most; b has a lower limit."""
    program = lower(laws()["self_tuning"], "fixed32")
    writers = {op.result.name: op for op in program.body}
    upper = writers["inverse_new"]
    nearer, limit = str(writers[str(upper.arguments[0])].arguments[0]), int(upper.arguments[1])
    ranges = Meaning(program).ranges
    x = np.arange(limit - 2_000_000, limit + 1)  # all b beside the lowest give less, as do all x further off
    lowest = int(ranges["b_new"][0])
    most = int(np.max((x * (2**27 - ((lowest * x + 2**18) >> 19)) + 2**25) >> 26))
    assert most < limit
    assert stays_within(program, ranges, nearer, ranges[nearer][0], most)
    assert not stays_within(program, ranges, nearer, ranges[nearer][0], most - 1)


@pytest.mark.slow
def test_what_a_rounding_drops_is_the_same_behind_it() -> None:
    """0.4 by whole steps of 256 never comes so near to the middle of two values that one more unit of it shows."""
    judge = bench(laws()["fuzzy_pid"], "fixed32", 1_000, 1)
    factors = [m for m in mutants(judge.bundle) if m.what == "number 1717986918 -> 1717986919" and "wide" in m.before]
    assert any(equivalent(judge.program, m) is not None for m in factors)
