"""Steps from states that inputs take long to reach are compared too, within what the proof lets happen."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bench.codegen.example_laws import laws
from bench.proofs.planting import Mutant, mutants, planted
from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.not_a_number import spelled_out
from firmloop.quantize.program import Program
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.any_state import STEPS, Departures, any_state, departures, opened
from firmloop.verify.reference import Machine
from firmloop.verify.run import verify
from firmloop.verify.stimuli.stimuli import stimuli
from firmloop.verify.verdict import Verdict
from tests.laws import pid


@cache
def _lowered(name: str, arithmetic: str) -> Program:
    return lower(laws()[name], arithmetic)


def _apart(program: Program, bundle: Bundle) -> Departures:
    link = LibraryLink(build_host(bundle, load_target("host")), program)
    return departures(program, link, any_state(program, 1, STEPS))


def _planted(program: Program, text: str, what: str) -> tuple[Bundle, Mutant]:
    bundle = emit(program, "firmloop generate x.toml")
    mutant = next(m for m in mutants(bundle) if text in m.before and m.what == what)
    return planted(bundle, mutant), mutant


@pytest.mark.parametrize(
    ("name", "arithmetic"),
    [("self_tuning", "fixed16"), ("tuned pid", "float32"), ("full pid", "fixed32"), ("mpc", "float32")],
)
def test_the_generated_code_agrees_from_any_state(name: str, arithmetic: str) -> None:
    program = _lowered(name, arithmetic)
    found = _apart(program, emit(program, "firmloop generate x.toml"))
    assert found.steps >= (400 if name == "mpc" else 10_000) and (found.differences, found.first) == (0, None)


def test_a_limit_that_no_stimulus_reaches_is_missed_when_it_is_gone() -> None:
    program = _lowered("self_tuning", "fixed16")
    found = _apart(program, _planted(program, "p12_new = fl_min", "limit removed")[0])
    assert found.differences > 0 and found.first is not None
    assert found.first.output == "self.p12" and "p11 = " in found.first.operation


def test_a_fault_that_only_shows_where_a_state_is_no_number_and_a_search_is_cut_short_differs() -> None:
    program = _lowered("mpc", "float32")
    bundle, _ = _planted(program, "(fresh != 0) ? 0.0F : self->planned", "number 0.0 -> 1.0")
    assert _apart(program, bundle).differences > 0


def test_states_are_drawn_from_what_a_step_can_leave() -> None:
    program = _lowered("self_tuning", "fixed16")
    drawn = any_state(program, 1, STEPS)
    limit = next(op for op in program.body if op.result.name == "p12_new").result.high
    column = drawn.columns[len(program.inputs) + [v.name for v in program.state].index("p12")]
    reached, random = np.split(column, 2)
    assert (reached.min(), reached.max()) == (-limit, limit)
    assert len(np.unique(reached)) > 1000
    assert random.min() < -(2**31) * 0.99 and random.max() > 2**31 * 0.99


@pytest.mark.parametrize("name", [*laws(), "pid with a rate limit"])
def test_outputs_of_a_float_controller_stay_in_their_ranges_whatever_bits_its_state_holds(name: str) -> None:
    limited = pid({"kp": 0.05, "ki": 1.4, "rate_limit_per_s": 2000.0})
    program = spelled_out(lower(laws().get(name, limited), "float32"))
    step, count = opened(program), 60 if program.solves else 3000
    random = np.random.default_rng(1)
    inputs = [random.uniform(v.low, v.high, count).astype(np.float32) for v in program.inputs]
    words = [random.integers(0, 2**32, count, dtype=np.uint32).view(np.float32) for _ in program.state]
    with np.errstate(all="ignore"):
        found = Machine(step).named(Machine(step).step([*inputs, *words], []))
    for value, store in zip(program.outputs, program.results, strict=True):
        assert np.all((found[store.source] >= value.low) & (found[store.source] <= value.high)), value.name


def _verdict(name: str, arithmetic: str, text: str, what: str, steps: int) -> Verdict:
    program = _lowered(name, arithmetic)
    bundle, _ = _planted(program, text, what)
    return verify(laws()[name], program, bundle, load_target("host"), [], steps, 1, None, lambda share, doing: None)


def test_a_verdict_on_the_host_counts_steps_from_any_state() -> None:
    verdict = _verdict("self_tuning", "fixed16", "p12_new = fl_min", "limit removed", 1000)
    assert verdict.differences > 0 and verdict.first is not None
    assert verdict.first.lane.startswith("any state") and verdict.first.unit == "1"


def test_a_parameter_that_init_sets_wrongly_differs() -> None:
    assert _verdict("tuned pid", "fixed16", "self->ki =", "store dropped", 3000).differences > 0


def test_a_state_that_init_leaves_out_differs() -> None:
    assert _verdict("state_space", "float32", "self->x_1 = 0", "store dropped", 1000).differences > 0


@pytest.mark.parametrize("arithmetic", ["fixed32", "float32"])
def test_a_status_word_that_says_nothing_differs_on_the_host(arithmetic: str) -> None:
    """Outputs and state are right: the status word alone is not."""
    program, steps = _lowered("full pid", arithmetic), 20_000
    bundle = emit(program, "firmloop generate x.toml")
    source = next(name for name in bundle.files if name.endswith(f"{program.name}.c"))
    head, step, body = bundle.files[source].partition("return (uint32_t)saturated;")
    assert step
    silent = replace(bundle, files={**bundle.files, source: f"{head}(void)saturated; return 0U;{body}"})
    verdict = verify(
        laws()["full pid"], program, silent, load_target("host"), [], steps, 1, None, lambda share, doing: None
    )
    assert verdict.differences > 0 and verdict.first is not None and verdict.first.output == "status"
    link = LibraryLink(build_host(silent, load_target("host")), program)
    found = departures(program, link, any_state(program, 1, steps))
    assert found.differences > 0 and found.first is not None and found.first.output == "status"
    blocks = stimuli(program, [], steps, 1)
    traces = run_blocks(program, blocks)
    compared = compare(program, link, blocks, traces, lambda share, doing: None)
    assert compared.differences == sum(np.count_nonzero(trace.status & 1) for trace in traces) > 0
