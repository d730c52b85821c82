"""A controller finds its own first sample, and whatever an input held, it is a controller again soon after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.graph import evaluator, law_graph
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical, to_raw
from tests.laws import FULL, TABLES, pid

LAWS = {
    **{name: kind.design(kind.example).law for name, kind in kinds().items()},
    **{n: pid(t) for n, t in TABLES.items()},
}
WORST = (np.nan, np.inf, -np.inf, np.finfo(np.float32).max)
SOON = 12  # samples in which what is infinite has become no number, and no number has been seen


def calm_inputs(program: Program, lanes: int, steps: int) -> np.ndarray:
    random = np.random.default_rng(4)
    scales = [2.0**-v.number.fraction for v in program.inputs]
    spans = [(v.low * s, v.high * s) for v, s in zip(program.inputs, scales, strict=True)]
    columns = [
        to_raw(v, random.uniform(*span, size=(lanes, steps))) for v, span in zip(program.inputs, spans, strict=True)
    ]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_no_input_leaves_anything_behind_that_is_no_number(name: str) -> None:
    program = lower(LAWS[name], "float32")
    inputs = calm_inputs(program, len(WORST) * len(program.inputs), 40)
    for lane in range(len(inputs)):
        inputs[lane, 5, lane % len(program.inputs)] = WORST[lane // len(program.inputs)]
    trace = run(program, inputs)
    for j, value in enumerate(program.outputs):
        assert np.all((trace.outputs[..., j] >= value.low) & (trace.outputs[..., j] <= value.high)), value.name
    assert np.all(np.isfinite(trace.state[:, 5 + SOON :]))


@pytest.mark.parametrize("left", [np.nan, np.inf, -np.inf])
def test_a_controller_whose_state_is_not_finite_starts_afresh_at_once_or_in_the_next_sample(left: float) -> None:
    program = lower(pid(FULL), "float32")
    inputs = calm_inputs(program, 1, 40)
    found = run(replace(program, start=(left,) * len(program.state)), inputs).outputs
    assert any(np.array_equal(found[:, k:], run(program, inputs[:, k:]).outputs) for k in (0, 1))


@pytest.mark.parametrize("arithmetic", ["float32", "float64", "fixed32", "fixed16"])
@pytest.mark.parametrize("name", ["full", "unfiltered", "tustin", "gain_schedule"])
def test_the_first_sample_is_as_if_its_inputs_had_always_stood(name: str, arithmetic: str) -> None:
    law: Law = LAWS[name]
    program = lower(law, arithmetic)
    inputs = calm_inputs(program, 300, 1)
    got = run(program, inputs).outputs[:, 0, 0].astype(np.float64) * 2.0 ** -program.outputs[0].number.fraction
    z = [to_physical(v, inputs[:, 0, j]) for j, v in enumerate(program.inputs)]
    graph = law_graph(law)
    expected = evaluator(graph)([[np.full(300, x) for x in law.start], z])[1][0]
    assert np.max(np.abs(got - expected)) <= program.rounding[0].bound
    assert law.first is not None
    settled = np.array(law.first.map(300)(np.tile(np.array(law.start)[:, None], 300), np.array(z)))
    again = evaluator(graph)([list(settled), z])[1][0]
    np.testing.assert_allclose(again, expected, rtol=0, atol=1e-12)


def test_the_flag_of_the_first_sample_is_no_state_of_the_program() -> None:
    names = [value.name for value in lower(pid(FULL), "fixed32").state]
    assert names == ["integral", "filtered"]
