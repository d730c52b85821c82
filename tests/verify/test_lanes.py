"""The compiled reference does what numpy gives as the meaning of each operation, and of whole programs and laws."""

import numpy as np
import pytest

from firmloop.design.kinds import kinds
from firmloop.quantize.lower.graph import MEANING, evaluator, law_graph
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.ops import OPERATIONS
from firmloop.quantize.program import Program
from firmloop.verify import reference
from firmloop.verify.lanes.codes import CODES, LAW, REAL, WHOLE
from firmloop.verify.lanes.compiled import Compiled, RowStep, library
from firmloop.verify.lanes.laws import SAME, compiled_law
from firmloop.verify.reference import Raw, Trace, run
from firmloop.verify.stimuli.settings import requests
from firmloop.verify.stimuli.stimuli import characters, stimuli
from tests.laws import FULL, pid, random_law

ONE = ("copy", "neg", "abs", "not", "none", "lost", "magnitude", "shr", "high", "asr", "high_down", "shl", "wrap")
CURVED = ("sin", "cos", "exp", "tanh", "sqrt", "turn", "turn_sine", "turn_cosine", "whole_root", "inverse")
ARITY = {
    **dict.fromkeys(ONE, 1),
    **dict.fromkeys(CURVED, 1),
    **dict.fromkeys(("select", "clamp", "mac", "mul_add", "mul_add_short", "outside", "beyond"), 3),
}
WORD = 2**31
NEEDS: dict[str, tuple[tuple[int, ...], ...]] = {  # the literal integers of operations
    **{name: ((1,), (15,), (30,)) for name in ("shr", "high", "asr", "high_down")},
    **{"wrap": ((1,), (7,), (31,)), "shl": ((1,), (30,)), "mul_shift": ((1,), (31,), (32,), (62,))},
    **{"mul_down": ((1,), (32,), (62,)), "whole_root": ((1,), (17,), (31,)), "inverse": ((0, 3), (15, 0), (16, 12))},
    **{"turn": ((2**30 - 1, 32), (-(2**29) - 5, 12))},
}


def columns(kind: str, count: int) -> Raw:
    """Return every combination of special values, and noise over many octaves behind them."""
    random = np.random.default_rng(1)
    if kind == "i8":
        special: Raw = np.array([0, 1, -1, 2, -2, WORD - 1, -WORD, 12345, -54321])
        noise: Raw = random.integers(-WORD, WORD, size=(count, 3000)) >> random.integers(0, 31, size=(count, 3000))
    else:
        tiny, most = float(np.finfo(kind).smallest_subnormal), float(np.finfo(kind).max)
        special = np.array([0.0, -0.0, 1.0, -2.5, tiny, -tiny, most, -most, np.inf, -np.inf, np.nan])
        noise = random.normal(size=(count, 3000)) * 10.0 ** random.uniform(-30, 30, size=(count, 3000))
    grid = np.array(np.meshgrid(*[special] * min(count, 3))).reshape(min(count, 3), -1)
    return np.concatenate([np.concatenate([grid, grid[: count - len(grid)]]), noise], axis=1).astype(kind)


def computed(kind: str, name: str, given: Raw, whole: tuple[int, ...]) -> Raw:
    code = library()
    assert code is not None
    places = tuple(range(len(given)))
    step = RowStep(name, len(given), places, whole)
    ready = Compiled(code, np.dtype(kind), [step], {}, places, (), (), [len(given)])
    return np.asarray(ready.results(given[None], np.empty((0, given.shape[1])))[0, 0])


def same(one: Raw, other: Raw) -> None:
    """Compare every bit, but of what is no number."""
    other = np.broadcast_to(np.asarray(other), one.shape).astype(one.dtype)
    lost = (one != one) & (other != other)
    bits = f"u{one.dtype.itemsize}"
    np.testing.assert_array_equal(np.where(lost, 0, one.view(bits)), np.where(lost, 0, other.view(bits)))


@pytest.mark.parametrize("kind", ["i8", "f4", "f8"])
def test_each_operation_means_what_numpy_computes(kind: str) -> None:
    for name in CODES | (WHOLE if kind == "i8" else REAL):
        given = columns(kind, ARITY.get(name, 2))
        if name in ("and", "or", "not", "select"):
            given[0] = np.arange(given.shape[1]) % 2
        if name in ("and", "or"):
            given[1] = np.arange(given.shape[1]) // 2 % 2
        for whole in NEEDS.get(name, ((),)):
            truths = name in ("and", "or")
            with np.errstate(all="ignore"):
                read = given.astype("i8") if truths else given
                expected = OPERATIONS[name].run(*read, *whole)
            same(computed(kind, name, given, whole), expected)


def test_each_operation_of_a_law_means_what_numpy_computes() -> None:
    for name, meaning in MEANING.items():
        code = SAME.get(name, name)
        if code not in CODES | REAL | LAW:
            continue
        arity = 1 if name in ("neg", "not", "abs", "square", "twice", *CURVED) else 3 if name == "choose" else 2
        given = columns("f8", arity)
        rows = {"square": [0, 0], "twice": [0, 0], "if": [0, 1, 2]}.get(name, list(range(arity)))
        read = np.concatenate([given, np.zeros((1, given.shape[1]))])[rows] if name == "if" else given[rows]
        with np.errstate(all="ignore"):
            found, expected = computed("f8", code, read, ()), meaning(*given)
        if code.startswith("true_"):  # libraries differ in the last places
            np.testing.assert_allclose(found, expected, rtol=1e-15, atol=1e-300)
        else:
            same(found, expected)


def both(program: Program, monkeypatch: pytest.MonkeyPatch) -> tuple[Trace, Trace]:
    inputs = np.concatenate([block.inputs for block in characters(program, 40, 30, 3)])
    asked = requests(program, np.random.default_rng(1), *inputs.shape[:2]) if program.tunable else None
    monkeypatch.setattr(reference, "MANY", 0)
    quick = run(program, inputs, asked)
    with monkeypatch.context() as patched:
        patched.setattr(reference, "library", lambda: None)
        return quick, run(program, inputs, asked)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_whole_programs_leave_the_same_trace(arithmetic: str, monkeypatch: pytest.MonkeyPatch) -> None:
    laws = [
        pid(FULL),
        pid({**FULL, "tunable": ["kp"], "ranges": {"kp": [0.0, 0.1]}}),
        random_law(np.random.default_rng(2)),
        *(kinds()[name].design(kinds()[name].example).law for name in ("cascade", "nmpc")),
    ]
    for law in laws[: 4 if arithmetic.startswith("fixed") else 5]:
        quick, plain = both(lower(law, arithmetic), monkeypatch)
        for one, other in ((quick.outputs, plain.outputs), (quick.status, plain.status), (quick.state, plain.state)):
            assert one.dtype == other.dtype
            same(np.ascontiguousarray(one), other)


def test_a_law_that_solves_runs_on_its_own_state_as_numpy_has_it() -> None:
    law, random = kinds()["nmpc"].design(kinds()["nmpc"].example).law, np.random.default_rng(6)
    graph, own = law_graph(law), range(len(law.state))
    low, high = np.array([(signal.low, signal.high) for signal in law.inputs]).T[:, None, :, None]
    inputs = random.uniform(low, high, size=(30, len(law.inputs), 50))
    ready = compiled_law(graph, len(law.state), len(law.inputs), own)
    assert ready is not None
    state, means = [np.full(50, x) for x in law.start], evaluator(graph)
    for found, row in zip(ready.results(inputs, np.array(state)), inputs, strict=True):
        following, outputs, *_ = means([state, list(row)])
        state = [np.broadcast_to(x, 50) for x in following]
        np.testing.assert_allclose(found, outputs, rtol=1e-9, atol=1e-9)  # libraries differ in the last places


def test_a_law_runs_on_its_own_state_as_numpy_has_it() -> None:
    law, random = random_law(np.random.default_rng(4)), np.random.default_rng(5)
    graph, inputs = law_graph(law), random.normal(size=(50, len(law.inputs), 300))
    ready = compiled_law(graph, len(law.state), len(law.inputs), range(len(law.state)))
    assert ready is not None
    state = [np.full(300, x) for x in law.start]
    found = ready.results(inputs, np.array(state))
    means = evaluator(graph)
    for k in range(50):
        following, outputs, *_ = means([state, list(inputs[k])])
        state = [np.broadcast_to(x, 300) for x in following]
        for one, other in zip(found[k], outputs, strict=True):
            same(one, other)


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_stimuli_meet_the_same_edges_with_compiled_code_and_without(
    arithmetic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = kinds()["sensorless_speed"]
    program = lower(kind.design(kind.example).law, arithmetic)
    quick = stimuli(program, [], 3000, 1)
    monkeypatch.setattr(reference, "library", lambda: None)
    for one, other in zip(quick, stimuli(program, [], 3000, 1), strict=True):
        assert one.inputs.tobytes() == other.inputs.tobytes(), one.name
