"""Large dense sums stand in a table and are added up in loops: the same bits, in fewer bytes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.identify.signal import Signal
from firmloop.quantize import rows
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.c_checker import check_source
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.reference import run
from firmloop.verify.run import verify


def dense(order: int) -> Law:
    """Return a stable controller with a weight for every pair, but one that is 0 and two that need no product."""
    random = np.random.default_rng(order)
    a = random.standard_normal((order, order))
    a *= 0.9 / np.max(np.abs(np.linalg.eigvals(a)))
    a[1, 2:4] = 1e-3 * np.array([1.0, -1.0])
    c = random.standard_normal((1, order))
    c[0, 0], c[0, 1] = 1.0, -1.0
    b = random.standard_normal((order, 1))
    b[order - 1, 0] = 0.0
    table = {"A": a.tolist(), "B": b.tolist(), "C": c.tolist(), "D": [[0.5]]}
    inputs, outputs = (Signal("y", "1", -1.0, 1.0),), (Signal("u", "1", -100.0, 100.0),)
    return design("state_space", "dense", table, 0.001, inputs, outputs, None).law


def straight(law: Law, arithmetic: str, monkeypatch: pytest.MonkeyPatch) -> Program:
    """Return the program in straight lines."""
    with monkeypatch.context() as patch:
        patch.setattr(rows, "cheaper", lambda *_: False)
        return lower(law, arithmetic)


@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
def test_loops_give_the_bits_of_straight_lines(arithmetic: str, monkeypatch: pytest.MonkeyPatch) -> None:
    law = dense(20)
    looped, lines = lower(law, arithmetic), straight(law, arithmetic, monkeypatch)
    assert [dict(table.sizes) for table in looped.tables] == [{"FL_ROWS": 20, "FL_ROW_VALUES": 21}]  # one row has a 0
    assert looped.rounding == lines.rounding and len(looped.body) < 0.15 * len(lines.body)
    given = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 40, 1)).astype(arithmetic)
    given[3, 5], given[4, 7] = np.nan, 3e38
    one, other = run(looped, given), run(lines, given)
    assert one.outputs.tobytes() == other.outputs.tobytes()
    assert one.state.tobytes() == other.state.tobytes() and np.array_equal(one.status, other.status)


def test_its_c_agrees_and_is_proven_statement_by_statement() -> None:
    law = dense(16)
    program = lower(law, "float32")
    assert program.tables
    bundle = emit(program, "firmloop generate project.toml")
    verdict = verify(law, program, bundle, load_target("host"), (), 20_000, 1, None, lambda share, doing: None)
    assert (verdict.differences, verdict.steps > 19_000) == (0, True)
    document = json.loads(json.dumps(proof(program, law.reasons)))
    check_proof(document)
    check_source(read_claims(document), bundle.files[bundle.sources[0]])
    document["tables"][0]["numbers"]["weight"][7] *= 1.5
    with pytest.raises(ProofError, match="row_data"):
        check_source(read_claims(document), bundle.files[bundle.sources[0]])


def test_small_and_sparse_laws_stay_in_straight_lines() -> None:
    assert not lower(dense(12), "float32").tables
    law = dense(20)
    assert not lower(law, "fixed32").tables


def test_a_sum_that_is_read_on_its_way_stays_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = straight(dense(16), "float32", monkeypatch)
    ends = {a.source for a in lines.next_state}
    inside = next(op for op in lines.body if op.function == "add" and op.result.name not in ends)
    read = replace(lines, status=(replace(lines.status[0], source=inside.result.name), *lines.status[1:]))
    assert inside.result.name in {op.result.name for op in rows.in_rows(read).body}
