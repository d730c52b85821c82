"""The explicit solution: every region, the optimum in each, and the same table read in Python and in C."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from firmloop.design.kinds.mpc.kind import design
from firmloop.design.law import DesignError, Law, Tree
from firmloop.design.outcome import INFEASIBLE, SOLVED
from firmloop.design.quadratic.solver import solver
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.quantize.twins.qp import optimum
from firmloop.verify.proofs.checker import ProofError, check_proof
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli
from tests.design.kinds.test_mpc import ANGLE, REFERENCE, SPEED, request, servo, table
from tests.quantize.test_quadratic import HARD, differences, law_of, random_states

ARITHMETICS = ["float32", "float64", "fixed32", "fixed16"]


def explicit(inputs: tuple[Signal, ...] = (ANGLE, SPEED), **keys: object) -> Law:
    return law_of(inputs, **{"horizon": 4, "solver": "explicit", **keys})


def two_drives() -> Law:
    a, b = servo()
    both = table((np.kron(np.eye(2), a), np.kron(np.eye(2), b)), horizon=1, Q=[200.0, 0.1] * 2, R=0.01)
    inputs = tuple(Signal(f"{name}_{k}", "1", -10.0, 10.0) for k in (1, 2) for name in ("angle", "speed"))
    outputs = tuple(Signal(f"voltage_{k}", "V", -6.0, 6.0) for k in (1, 2))
    return design(request({**both, "solver": "explicit"}, inputs, outputs)).law


CASES: dict[str, Callable[[], Law]] = {
    "limits of u": explicit,
    "hard limits of x": lambda: explicit(**HARD),
    "changes, a soft limit, a reference": lambda: explicit(
        (REFERENCE, ANGLE, SPEED), horizon=4, blocks=[1, 3], du_min=-1.0, du_max=1.5, x_max=[np.inf, 12.0], x_soft=9.0
    ),
    "two drives": two_drives,
}


@functools.cache
def law_in(case: str) -> Law:
    return CASES[case]()


@pytest.fixture(scope="module")
def hard() -> Law:
    return law_in("hard limits of x")


@pytest.mark.parametrize("case", CASES)
def test_in_every_region_the_law_is_the_optimum(case: str) -> None:
    law = law_in(case)
    assert law.solve is not None and isinstance(law.solve.method, Tree)
    states = random_states(law, 1500, seed=8)
    split = law.solve.function.size1_in(0)
    past = np.random.default_rng(2).uniform(-6, 6, (len(states), split))
    parameters = np.array(law.solve.function.map(len(states))(past.T, states.T)).T
    best, found = optimum(law.solve.problem, parameters), solver(law.solve, optimum)(parameters)
    np.testing.assert_array_equal(found.status, best.status)
    good = best.status == SOLVED
    assert np.count_nonzero(good) > 300 and np.any(~good) == (case == "hard limits of x")
    assert np.max(np.abs(found.moves - best.moves)[good]) < 1e-9
    assert found.work.max() <= law.solve.method.depth


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_c_is_the_program_and_the_program_near_the_law(hard: Law, arithmetic: str) -> None:
    program = lower(hard, arithmetic)
    wrong, words = differences(program, 1500)
    not_a_number = set() if arithmetic.startswith("fixed") else {2}
    assert wrong == 0 and words == {0, 1} | not_a_number
    blocks = stimuli(program, [], 300, 3)
    (rounded,) = measure_rounding(hard, program, blocks, [run(program, block.inputs) for block in blocks])
    assert rounded.worst < (1e-3 if arithmetic == "fixed16" else 1e-4)


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32"])
@pytest.mark.parametrize("case", ["changes, a soft limit, a reference", "two drives"])
def test_c_is_the_program_with_more_of_everything(case: str, arithmetic: str) -> None:
    law = law_in(case)
    program = lower(law, arithmetic)
    assert differences(program, 600)[0] == 0
    if arithmetic == "fixed32":
        checked = check_proof(proof(program, law.reasons))
        assert checked is not None and checked.operations == len(program.body)


def test_outside_the_output_is_the_free_one_limited(hard: Law) -> None:
    assert hard.solve is not None
    parameters = np.array([[9.0, 50.0], [0.01, 0.0]])
    found = solver(hard.solve, optimum)(parameters)
    assert list(found.status) == [INFEASIBLE, SOLVED]
    problem = hard.solve.problem
    np.testing.assert_allclose(found.moves, parameters @ problem.slope[:1].T * problem.scale, rtol=1e-9)


def test_what_is_no_number_gives_an_output_within_limits(hard: Law) -> None:
    lanes = np.array([[[np.nan, 0.0]], [[np.inf, 1.0]], [[3e38, -3e38]], [[0.1, -np.inf]]], dtype=np.float32)
    assert np.all(np.abs(run(lower(hard, "float32"), lanes).outputs) <= 6.0)


BROKEN: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "a circle": (lambda table: table["numbers"]["below"].__setitem__(3, 1), "node 3 leads to 1, which is no later"),
    "a law that is not there": (lambda table: table["numbers"]["above"].__setitem__(0, -99), "node 0 leads to -99"),
    "too few steps": (lambda table: table["sizes"].__setitem__("FL_TREE_DEPTH", 2), r"has \d+ nodes, more than 2"),
    "a sum too large": (
        lambda table: table["numbers"]["law"].__setitem__(slice(None), [2**31 - 1] * len(table["numbers"]["law"])),
        r"a law may reach \d+, beyond",
    ),
    "a shift of the whole word": (lambda table: table["sizes"].__setitem__("FL_SHIFT_LAW", 64), "FL_SHIFT_LAW is 64"),
    "a move beyond its range": (lambda table: table["numbers"]["most"].__setitem__(0, 2**31 - 1), "move 0 may be"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_the_checker_finds_what_does_not_fit(hard: Law, case: str) -> None:
    document = json.loads(json.dumps(proof(lower(hard, "fixed32"), hard.reasons)))
    assert check_proof(document) is not None
    change, says = BROKEN[case]
    change(document["tables"][0])
    with pytest.raises(ProofError, match=says):
        check_proof(document)


@pytest.mark.parametrize(("horizon", "form"), [(12, "fl_tree_t"), (30, "fl_qp_t")])
def test_auto_takes_a_table_while_it_is_smaller(horizon: int, form: str) -> None:
    law = explicit((ANGLE, SPEED), horizon=horizon, blocks=[1, 3, horizon - 4], solver="auto")
    if horizon == 30:
        law = explicit((ANGLE, SPEED), horizon=30, solver="auto")
    program = lower(law, "float32")
    assert [table.form for table in program.tables] == [form]
    assert differences(program, 300)[0] == 0


def test_too_many_regions_and_parameters_are_refused_with_their_number() -> None:
    with pytest.raises(DesignError, match=r"finds \d+ regions and more for 30 rows and 2 parameters, at most 400"):
        explicit(horizon=30)
    model = np.diag([0.9, 0.8, 0.7, 0.6]), np.ones((4, 1))
    own = table(model, horizon=3, Q=[1.0] * 4, R=1.0, du_max=1.0, offset_free=True, solver="explicit")
    inputs = tuple(Signal(f"x_{k}", "1", -1.0, 1.0) for k in range(4))
    with pytest.raises(DesignError, match=r"cuts the space of 7 parameters .* at most 6"):
        design(request(own, (REFERENCE, *inputs)))
