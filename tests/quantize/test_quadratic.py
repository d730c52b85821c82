"""The quadratic program as an operation: right, bounded in its work, and the same in Python and in C."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from bench.mpc.random_problems import law_of as random_law
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds.mpc.kind import design
from firmloop.design.law import Law
from firmloop.design.outcome import CAPPED, INFEASIBLE, SOLVED
from firmloop.design.quadratic.region import drawn_parameters
from firmloop.identify.signal import Signal
from firmloop.quantize.formats.quadratic import rows_of, table_of
from firmloop.quantize.lower.budget import DRAWN, budget_of
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.twins.qp import exact, solve
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli
from tests.design.kinds.test_mpc import ANGLE, REFERENCE, SERVO, SPEED, cart_pole, request, servo, table

HOST = load_target("host")
HARD = {"x_min": [-3.0, -15.0], "x_max": [3.0, 15.0]}


def law_of(inputs: tuple[Signal, ...] = (ANGLE, SPEED), **keys: object) -> Law:
    return design(request({**table(servo(), **SERVO), **keys}, inputs)).law


def random_states(law: Law, count: int, seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    low, high = (np.array([getattr(wire, end) for wire in law.inputs]) for end in ("low", "high"))
    return random.uniform(low, high, size=(count, len(low))) * random.uniform(0, 1, size=(count, 1))


def differences(program: Program, steps: int) -> tuple[int, set[int]]:
    """How many steps differ between C and reference, and which status words the reference gave."""
    blocks = stimuli(program, [], steps, 3)
    traces = run_blocks(program, blocks)
    library = LibraryLink(build_host(emit(program, "firmloop generate x.toml"), HOST), program)
    done = compare(program, library, blocks, traces, lambda part, label: None)
    return done.differences, {int(word) & 3 for trace in traces for word in trace.status.ravel()}


def test_the_optimum_is_another_solvers() -> None:
    """The multipliers of a solver for the dual, min 1/2 m'Gm - y0'm + high m+ - low m-, give the same rows."""
    law = law_of(**HARD)
    assert law.solve is not None
    problem, states = law.solve.problem, random_states(law, 150)
    found = solve(exact(problem), states)
    assert set(found.status) == {SOLVED, INFEASIBLE}
    size = len(problem.low)
    both = np.hstack([np.eye(size), -np.eye(size)])
    hessian = ca.DM(both.T @ problem.gram @ both)
    solver = ca.conic("dual", "qpoases", {"h": hessian.sparsity()}, {"printLevel": "none"})
    for state, move, status in zip(states, found.moves[:, 0], found.status, strict=True):
        free = problem.slope @ state
        edge = np.concatenate([problem.high, -problem.low])
        if status == SOLVED:
            best = solver(h=hessian, g=edge - both.T @ free, lbx=0, ubx=np.inf)
            rows = free - problem.gram @ (both @ np.array(best["x"]).ravel())
            assert abs(rows[0] * problem.scale[0] - move) < 1e-7


def test_single_precision_is_near_and_says_the_same() -> None:
    law = law_of(**HARD)
    assert law.solve is not None
    states = random_states(law, 3000).astype(np.float32)
    narrow = solve(rows_of(table_of(law.solve.problem, "float32", "plan", 10**6, False), np.dtype("f4")), states)
    wide = solve(exact(law.solve.problem), states.astype(np.float64))
    np.testing.assert_array_equal(narrow.status, wide.status)
    assert np.max(np.abs(np.clip(narrow.moves, -6, 6) - np.clip(wide.moves, -6, 6))) < 1e-4


def test_without_an_answer_the_moves_are_those_without_limits() -> None:
    law = law_of(**HARD)
    assert law.solve is not None
    problem, states = law.solve.problem, random_states(law, 300)
    free = states @ problem.slope[0] * problem.scale[0]
    found = solve(exact(problem), states)
    cut = solve(replace(exact(problem), budget=15), states)
    assert np.count_nonzero(cut.status == CAPPED) > 30 and np.max(cut.work) < 15 + 6 + problem.freedom
    assert np.max(cut.work) <= replace(exact(problem), budget=15).longest
    for solution in (found, cut):
        np.testing.assert_allclose(solution.moves[solution.status != SOLVED, 0], free[solution.status != SOLVED])


CASES = {
    "hard limits": ((ANGLE, SPEED), HARD),
    "all of it": (
        (REFERENCE, ANGLE),
        {"C": [[1.0, 0.0]], "observer": "kalman", "process_noise": [1e-8, 1e-3], "measurement_noise": 1e-6,
         "offset_free": True, "delay_periods": 2, "du_min": -1.0, "du_max": 1.5, "x_max": [np.inf, 12.0],
         "x_soft": 100.0, "blocks": [1, 1, 1, 3, 9]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
@pytest.mark.parametrize("case", CASES)
def test_c_is_the_reference(case: str, arithmetic: str) -> None:
    inputs, keys = CASES[case]
    wrong, words = differences(lower(law_of(inputs, **keys), arithmetic), 60 if "C" in keys else 400)
    assert wrong == 0 and 0 in words


def test_c_is_the_reference_where_the_search_is_cut_short() -> None:
    wrong, words = differences(lower(law_of(**HARD, budget=30), "float32"), 2000)
    assert wrong == 0 and words >= {0, CAPPED, INFEASIBLE}


def test_c_is_the_reference_of_a_program_with_more_rows_than_a_byte_counts() -> None:
    program = lower(law_of(**HARD, horizon=100), "float32")
    assert dict(program.tables[0].sizes)["FL_QP_ROWS"] == 300
    wrong, words = differences(program, 400)
    assert wrong == 0 and words >= {0, INFEASIBLE}


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_factor_of_the_active_rows_finds_what_a_tableau_of_all_finds(kind: type) -> None:
    law = law_of(**HARD)
    assert law.solve is not None
    table_ = table_of(law.solve.problem, np.dtype(kind).name, "plan", 10**4, False)
    factor = rows_of(table_, np.dtype(kind))
    assert factor.many and table_.support == "fl_qp_many.h"
    states = random_states(law, 3000).astype(kind)
    one, other = (solve(replace(factor, many=many), states) for many in (True, False))
    np.testing.assert_array_equal(one.status, other.status)
    assert set(one.status) == {SOLVED, INFEASIBLE} and np.count_nonzero(one.side, axis=1).max() > 5
    assert np.max(np.abs(one.moves - other.moves)) < (1e-3 if kind is np.float32 else 1e-9)


@pytest.mark.parametrize("case", CASES)
def test_what_is_no_number_gives_an_output_within_limits_and_is_forgotten(case: str) -> None:
    """Each input in turn is NaN, infinite or huge for one sample; where it is not finite, as if that had not been."""
    inputs, keys = CASES[case]
    program = lower(law_of(inputs, **keys), "float32")
    worst = (np.nan, np.inf, -np.inf, np.finfo(np.float32).max)
    random = np.random.default_rng(4)
    ends = [(wire.low, wire.high) for wire in program.inputs]
    lanes = np.stack([random.uniform(low, high, (len(worst) * len(ends), 40)) for low, high in ends], axis=-1)
    lanes = (0.02 * lanes).astype(np.float32)  # small enough that no search is cut short
    for lane in range(len(lanes)):
        lanes[lane, 5, lane % len(ends)] = worst[lane // len(ends)]
    trace = run(program, lanes)
    (output,) = program.outputs
    assert np.all((trace.outputs >= output.low) & (trace.outputs <= output.high))
    assert np.all(np.isfinite(trace.state[:, 12:]))
    asked = (len(worst) - 1) * len(ends)  # a huge number is one: the observer forgets it in its own time
    left = run(program, np.delete(lanes[:asked], 5, axis=1))
    np.testing.assert_array_equal(np.delete(trace.outputs[:asked], 5, axis=1), left.outputs)
    blocks, library = [Block("no number", lanes)], build_host(emit(program, "firmloop generate x.toml"), HOST)
    done = compare(program, LibraryLink(library, program), blocks, [trace], lambda part, label: None)
    assert (done.steps, done.differences) == (lanes.shape[0] * lanes.shape[1], 0)


@pytest.mark.parametrize(("weight", "horizon"), [(3e3, 12), (1e5, 12)])
def test_stiff_soft_limits_beside_limited_changes_are_solved_in_single_precision(weight: float, horizon: int) -> None:
    limits = {"du_min": -2.0, "du_max": 2.0, "x_max": [np.inf, 20.0], "x_min": [-np.inf, -20.0], "x_soft": weight}
    law = law_of((REFERENCE, ANGLE, SPEED), horizon=horizon, **limits)
    assert law.solve is not None and law.state[0].name == "past_1"
    states = random_states(law, 80)
    past = np.zeros((len(states), len(law.state)))
    past[:, 0] = np.random.default_rng(3).uniform(-6, 6, len(states))
    parameters = np.array(law.solve.function.map(len(states))(past.T, states.T)).T.astype(np.float32)
    rows = rows_of(table_of(law.solve.problem, "float32", "plan", 10**4, False), np.dtype("f4"))
    found, best = solve(rows, parameters), solve(exact(law.solve.problem), parameters.astype(np.float64))
    assert set(found.status) == set(best.status) == {SOLVED}
    assert np.max(np.abs(np.clip(found.moves[:, 0], -6, 6) - np.clip(best.moves[:, 0], -6, 6))) < 2e-2


LARGE = {
    "blocks, changes and soft limits": CASES["all of it"],
    "thirty moves and their changes": (
        (ANGLE, SPEED),
        {"horizon": 30, "du_min": -1.0, "du_max": 1.0, "Q": [200.0, 0.0], "R": 1e-2},
    ),
}


@pytest.mark.parametrize("case", LARGE)
def test_where_multipliers_get_large_answers_are_refined(case: str) -> None:
    """Taken as they are, some searches end wrong, or say of limits that can be kept that they cannot."""
    inputs, keys = LARGE[case]
    law = law_of(inputs, **keys)
    assert law.solve is not None
    problem = law.solve.quadratic
    parameters = drawn_parameters(law, 30, 2)[:60].astype(np.float32)
    best = solve(exact(problem), parameters.astype(np.float64))
    plain, checked = (
        solve(rows_of(table_of(problem, "float32", "plan", 10**4, check), np.dtype("f4")), parameters)
        for check in (False, True)
    )
    away = [np.abs(np.clip(found.moves[:, 0], -6, 6) - np.clip(best.moves[:, 0], -6, 6)) for found in (plain, checked)]
    assert set(best.status) == set(checked.status) == {SOLVED} and away[1].max() < 2e-3
    rows = rows_of(table_of(problem, "float32", "plan", 400, True), np.dtype("f4"))
    short = solve(rows, parameters)
    assert np.any(short.status == CAPPED) and np.max(short.work) <= rows.longest
    assert np.any(plain.status == INFEASIBLE)


def test_where_float64_goes_round_in_circles_generation_ends() -> None:
    """Near the end of a track no moves keep every limit, and positions that follow each other hardly differ: pivots are
    roundings, in double precision too."""
    sizes = {"position": ("m", 1.0), "angle": ("rad", 0.3), "speed": ("m/s", 1.0), "turning": ("rad/s", 1.5)}
    inputs = tuple(Signal(name, unit, -size, size) for name, (unit, size) in sizes.items())
    free = np.inf
    own = table(
        cart_pole(), horizon=20, Q=[10.0, 1.0, 0.1, 0.1], R=0.1,
        x_min=[-1.0, -0.25, -free, -free], x_max=[1.0, 0.25, free, free],
    )  # fmt: skip
    law = design(request(own, inputs, (Signal("force", "1", -1.0, 1.0),))).law
    assert law.solve is not None
    state = np.array([[0.959377417019313, 0.2843906429114131, 0.007353958401157934, 0.7603396157517155]])
    problem, rng = law.solve.quadratic, np.random.default_rng(0)
    near = (problem.gram * (1.0 + 1e-14 * rng.standard_normal(problem.gram.shape)) for _ in range(300))
    # Which of them goes round depends on the last bits, and those on the machine that designs.
    problems = (replace(problem, gram=each) for each in near)
    circling = next(each for each in problems if solve(exact(each), state).status == [CAPPED])
    assert CAPPED in solve(exact(circling), drawn_parameters(law, DRAWN, 0)).status
    assert budget_of(law, circling, "float32")[0] < 2000


@pytest.mark.parametrize(("seed", "lane"), [(55, 372), (109, 371)])
def test_an_answer_whose_multipliers_are_roundings_is_not_called_solved(seed: int, lane: int) -> None:
    """States of which float64 says that no moves keep every limit, and single precision once found some."""
    law = random_law(seed)[1]
    assert law.solve is not None
    problem = law.solve.problem
    parameters = drawn_parameters(law, 200, 7)[lane : lane + 1].astype(np.float32)
    assert solve(exact(problem), parameters.astype(np.float64)).status == [INFEASIBLE]
    budget, checked = budget_of(law, problem, "float32")
    assert solve(rows_of(table_of(problem, "float32", "plan", budget, checked), np.dtype("f4")), parameters).status > 0


def test_soft_limits_never_leave_no_moves() -> None:
    program = lower(law_of(x_min=[-3.0, -15.0], x_max=[3.0, 15.0], x_soft=10.0), "float32")
    assert [bit.name for bit in program.status] == ["capped", "not_a_number"]
