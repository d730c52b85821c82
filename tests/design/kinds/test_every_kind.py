"""What every controller kind must pass, found by discovery: its formula, its proofs, its C."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Request
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.graph import evaluator, law_graph
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import QuantizeError
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare, record_type
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.stimuli.stimuli import stimuli
from tests.kind_formulas import FORMULAS
from tests.quantize.test_lower import leaves_bounds

HOST = load_target("host")
EXAMPLES = [(kind.name, name, request) for kind in kinds().values() for name, request in kind.examples.items()]
NAMES = [name for _, name, _ in EXAMPLES]
EVERY = [(kind, request) for kind, _, request in EXAMPLES]
QUICK = (("gain_schedule_filters", "fixed32"), ("gain_schedule_feedback", "fixed16"))  # of the further examples
IN_C = [
    pytest.param(
        *(kind, request, arithmetic),
        id=f"{name}-{arithmetic}",
        marks=[] if name == kind or (name, arithmetic) in QUICK else [pytest.mark.slow],
    )
    for kind, name, request in EXAMPLES
    for arithmetic in ARITHMETICS
]


@cache
def designed(kind: str, place: int) -> Law:
    """Return the law of an example, by its place in EXAMPLES: the same one for all tests, which leave it as it is."""
    return kinds()[kind].design(EXAMPLES[place][2]).law


def law_of(kind: str, wanted: Request) -> Law:
    return designed(kind, next(k for k, each in enumerate(EXAMPLES) if each[2] is wanted))


def rows_of(law: Law, steps: int, seed: int) -> np.ndarray:
    """Slow walks over each input's range with small departures, so that no limit holds for long."""
    random = np.random.default_rng(seed)
    low, high = (np.array([getattr(wire, end) for wire in law.inputs]) for end in ("low", "high"))
    walk = np.cumsum(random.normal(size=(steps, 1)), axis=0) * 0.02 + random.uniform(-1, 1)
    apart = np.cumsum(random.normal(size=(steps, len(low))), axis=0) * 0.002
    return low + (high - low) * (0.5 + 0.5 * np.sin(walk + apart + 0.01 * random.normal(size=apart.shape)))


def free_run(law: Law, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States after each sample, outputs, flags."""
    if law.solve is not None:
        state = [np.full(len(rows), x) for x in law.start]  # each row on its own, so that all are solved at once
        x, u, flags, _ = evaluator(law_graph(law))([state, list(rows.T)])
        return np.array(x).T.reshape(len(rows), -1), np.array(u).T, np.array(flags).T
    x, u, flags, _ = law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)
    return np.array(x).T, np.array(u).T, np.array(flags).T


def test_every_kind_has_a_formula() -> None:
    assert set(kinds()) == set(FORMULAS)


@pytest.mark.parametrize(("kind", "wanted"), EVERY, ids=NAMES)
def test_the_law_is_the_formula(kind: str, wanted: Request) -> None:
    law = law_of(kind, wanted)
    free = 0.0
    for seed in range(4):
        rows = rows_of(law, 1500, seed)
        _, u, flags = free_run(law, rows)
        expected = FORMULAS[kind](wanted, rows)
        scale = np.array([wire.high - wire.low for wire in law.outputs])
        assert np.max(np.abs(u - expected) / scale) < 1e-9
        free += float(np.mean(flags == 0)) / 4
    assert free > 0.05, "the output is not always at its limit"


@pytest.mark.parametrize(("kind", "wanted"), EVERY, ids=NAMES)
def test_no_state_leaves_its_range_and_none_is_much_wider(kind: str, wanted: Request) -> None:
    law = law_of(kind, wanted)
    random = np.random.default_rng(3)
    low, high = (np.array([getattr(wire, end) for wire in law.inputs]) for end in ("low", "high"))
    most = np.zeros(len(law.state))
    for longest in (1, 10, 100, 1000):
        steps = 6000
        dwell = np.exp(random.uniform(0, np.log(longest + 1), steps)).astype(int) + 1
        piece = np.repeat(np.arange(steps), dwell)[:steps]
        rows = np.where(random.random((steps, len(low))) < 0.5, low, high)[piece]
        x, _, _ = free_run(law, rows)
        for k, state in enumerate(law.state):
            assert state.low <= x[:, k].min() and x[:, k].max() <= state.high, state.name
            most[k] = max(most[k], np.max(np.abs(x[:, k])) / max(abs(state.low), abs(state.high)))
    assert all(np.isfinite([signal.low, signal.high]).all() for signal in law.state)
    assert len(most) == 0 or most.min() > 0.02


@pytest.mark.parametrize(("kind", "wanted", "arithmetic"), IN_C)
def test_program_and_c(kind: str, wanted: Request, arithmetic: str) -> None:
    """The program keeps bounds and distance; the C is the program; two instances do not touch; init starts over.

    In float64 the C is also the formula, which a stranger may write from the contract alone.
    """
    law = law_of(kind, wanted)
    if law.solve is not None and arithmetic.startswith("fixed"):
        with pytest.raises(QuantizeError, match="no fixed-point form"):
            lower(law, arithmetic)
        return
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 6_000, 5)
    traces = run_blocks(program, blocks)
    assert leaves_bounds(program, blocks) == []
    for rounded in measure_rounding(law, program, blocks, traces):
        assert rounded.worst <= rounded.bound < np.inf

    library = build_host(emit(program, "firmloop generate test.toml"), HOST)
    one, other = LibraryLink(library, program), LibraryLink(library, program)
    done = compare(program, one, blocks, traces, lambda fraction, label: None)
    assert (done.steps, done.differences) == (6_000, 0)
    lanes = [np.ascontiguousarray(lane[:200]) for lane in blocks[0].inputs[:2]]
    size = lanes[0].itemsize * lanes[0].shape[1]
    alone = []
    for link, lane in zip((one, other), lanes, strict=True):
        link.reset()
        alone.append(link.step(lane.tobytes(), len(lane)))
    one.reset()
    other.reset()
    mixed = [b"", b""]
    for k in range(len(lanes[0])):
        for i, link in enumerate((one, other)):
            mixed[i] += link.step(lanes[i].tobytes()[k * size : (k + 1) * size], 1)
    assert mixed == alone

    if arithmetic == "float64":
        rows = rows_of(law, 500, 0)
        one.reset()
        got = np.frombuffer(one.step(rows.astype("<f8").tobytes(), len(rows)), record_type(program))
        u = np.stack([got[f"out_{wire.name}"] for wire in law.outputs], axis=-1)
        scale = np.array([wire.high - wire.low for wire in law.outputs])
        assert np.max(np.abs(u - FORMULAS[kind](wanted, rows)) / scale) < 1e-9
