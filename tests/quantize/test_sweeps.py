"""A fixed number of iterations: near the optimum, proven in fixed point, and the same in Python and in C."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from firmloop.design.law import DesignError, Law
from firmloop.design.outcome import CAPPED, INFEASIBLE, SOLVED
from firmloop.design.quadratic.solver import solver
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.quantize.twins.qp import optimum
from firmloop.verify.proofs.checker import ProofError, check_proof
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli
from tests.design.kinds.test_mpc import ANGLE, REFERENCE, SERVO, SPEED
from tests.quantize.test_quadratic import CASES, differences, law_of, random_states

SHORT = {"horizon": 8, "solver": "fixed_iterations"}
ARITHMETICS = ["float32", "fixed32", "fixed16"]


def sweeping(inputs: tuple[Signal, ...] = (ANGLE, SPEED), **keys: object) -> Law:
    return law_of(inputs, **{**SHORT, **keys})


@pytest.fixture(scope="module")
def plain() -> Law:
    return sweeping()


@pytest.mark.parametrize("keys", [{}, {"accuracy": 0.001}, {"x_max": [np.inf, 25.0], "x_soft": 10.0}], ids=str)
def test_every_output_is_as_near_to_the_optimum_as_asked(keys: dict[str, object]) -> None:
    law = sweeping(**keys)
    assert law.solve is not None and law.solve.method is not None
    states = random_states(law, 2000, seed=77) * np.geomspace(0.02, 1.0, 2000)[:, None]
    best, found = optimum(law.solve.problem, states), solver(law.solve, optimum)(states)
    assert set(best.status) == {SOLVED}
    away = np.abs(found.moves - np.clip(best.moves, -6, 6))
    assert away.max() <= float(keys.get("accuracy", 0.01)) * 12.0  # type: ignore[arg-type]
    assert 0.1 < np.mean(np.abs(best.moves) == 6) < 0.9, "a limit acts on some first moves"


def test_no_sweep_takes_two_starts_apart(plain: Law) -> None:
    assert plain.solve is not None and plain.solve.method is not None
    ends = np.linalg.eigvalsh(plain.solve.method.mix)
    assert 0 <= ends[0] and ends[-1] <= 1


def test_what_has_no_optimum_is_called_capped() -> None:
    law = sweeping(x_min=[-0.5, -np.inf], x_max=[0.5, np.inf], horizon=5, accuracy=0.05)
    assert law.solve is not None
    states = random_states(law, 500)
    best, found = optimum(law.solve.problem, states), solver(law.solve, optimum)(states)
    assert np.count_nonzero(best.status == INFEASIBLE) > 300
    assert np.mean(found.status[best.status == INFEASIBLE] == CAPPED) > 0.98
    assert np.all(found.status[best.status == SOLVED] == SOLVED)
    assert np.max(np.abs(found.moves)) <= 6.0


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_c_is_the_program_and_the_program_within_its_bound_of_the_law(plain: Law, arithmetic: str) -> None:
    program = lower(plain, arithmetic)
    wrong, words = differences(program, 1500)
    assert wrong == 0 and 0 in words
    blocks = stimuli(program, [], 300, 3)
    (rounded,) = measure_rounding(plain, program, blocks, [run(program, block.inputs) for block in blocks])
    assert rounded.worst <= rounded.bound < 0.05 and rounded.worst < 1e-3


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_sweeps_with_observer_disturbance_and_delay_c_is_the_program(arithmetic: str) -> None:
    inputs, keys = CASES["all of it"]
    free = {"du_min": -np.inf, "du_max": np.inf, "x_max": np.inf}
    law = sweeping(inputs, **{**keys, **free, "blocks": [1, 1, 6]})
    program = lower(law, arithmetic)
    wrong, words = differences(program, 60)
    assert wrong == 0 and 0 in words
    if arithmetic != "float32":
        checked = check_proof(proof(program, law.reasons))
        assert checked is not None and checked.operations == len(program.body)


BROKEN: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "larger weights": (
        lambda table: _fill(table["numbers"]["mix"], 2**31 - 1),
        r"7 \(y - c\) \+ 2 may reach \d+, beyond 2147483647",
    ),
    "a number beyond its word": (lambda table: _set(table["numbers"]["push"], 0, 2**31), "not within 32 bits"),
    "a shorter shift": (lambda table: _set(table["sizes"], "FL_SHIFT_PUSH", 1), r"push may reach \d+"),
    "limits beyond reach": (lambda table: _set(table["numbers"]["high"], 0, 2**30), "limits of row 0"),
    "a move beyond its range": (lambda table: _set(table["numbers"]["most"], 0, 2**31 - 1), "move 0 may be"),
    "rows left out": (lambda table: table["numbers"]["mix"].pop(), "do not belong together"),
}


def _set(place: Any, key: int | str, value: int) -> None:
    place[key] = value


def _fill(place: list[int], value: int) -> None:
    place[:] = [value] * len(place)


@pytest.mark.parametrize("case", BROKEN)
def test_the_checker_finds_what_does_not_fit(plain: Law, case: str) -> None:
    document = json.loads(json.dumps(proof(lower(plain, "fixed32"), plain.reasons)))
    assert check_proof(document) is not None
    change, says = BROKEN[case]
    change(document["tables"][0])
    with pytest.raises(ProofError, match=says):
        check_proof(document)


def test_what_is_no_number_gives_an_output_within_limits(plain: Law) -> None:
    program = lower(plain, "float32")
    lanes = np.array([[[np.nan, 0.0]], [[np.inf, 1.0]], [[3e38, -3e38]], [[0.1, -np.inf]]], dtype=np.float32)
    trace = run(program, lanes)
    assert np.all(np.abs(trace.outputs) <= 6.0)
    bits = {bit.name: bit.bit for bit in program.status}
    assert np.all(trace.status[[0, 1, 3]] == 1 << bits["not_a_number"])


def test_what_no_number_of_iterations_reaches_is_refused_with_the_error_left() -> None:
    with pytest.raises(DesignError, match=r"400 iterations leave an error of [\d.e-]+ of the output's range, .*0.0001"):
        sweeping(
            (REFERENCE, ANGLE, SPEED), horizon=15, Q=SERVO["Q"], du_min=-1.0, du_max=1.0, accuracy=1e-4,
            x_max=[np.inf, 5.0], x_soft=1e3, offset_free=True,
        )  # fmt: skip


def test_the_accuracy_asked_for_has_a_range() -> None:
    with pytest.raises(DesignError, match=r"controller.accuracy = 0.0 is out of range; it must be at least 0.0001"):
        sweeping(accuracy=0.0)
