"""A state word that holds anything leads to no undefined behavior, and is back in its range one step later."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bench.codegen.example_laws import laws
from bench.proofs.flipped_bits import Flipped, on_core, on_host, programs, settled
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Op, Program
from firmloop.verify.reference import Machine

STEPS = 10_000
NAMES = ("full pid", "tuned pid", *kinds())
SOLVING = ("mpc", "nmpc")  # in floating point alone
FIXED = [f"{name}, {arithmetic}" for name in NAMES if name not in SOLVING for arithmetic in ("fixed32", "fixed16")]
FLOAT = [f"{name}, float32" for name in NAMES]


@cache
def _program(name: str) -> Program:
    law, _, arithmetic = name.partition(", ")
    return lower(laws()[law], arithmetic)


def test_every_kind_with_a_state_is_stepped_in_every_format_it_has() -> None:
    assert [*programs(laws(), ("fixed32", "fixed16"))] == FIXED
    assert [*programs(laws(), ("float32",))] == FLOAT


@pytest.mark.parametrize("name", FIXED)
def test_every_fixed_point_kind_steps_from_random_states_under_the_sanitizers(name: str) -> None:
    assert on_host(_program(name), STEPS) == Flipped(STEPS, 0, 0, "")


@pytest.mark.parametrize("name", FLOAT)
def test_every_floating_point_kind_steps_from_words_of_any_bits_under_the_sanitizers(name: str) -> None:
    steps = 3 * settled(_program(name)) * (1 if _program(name).tables else 100)
    assert on_host(_program(name), steps) == Flipped(steps, 0, 0, "")


@pytest.mark.parametrize("name", ["full pid, float32", "notch, float32", "self_tuning, float32"])
def test_an_emulated_core_steps_from_words_of_any_bits(name: str) -> None:
    steps = 100 * settled(_program(name))
    assert on_core(_program(name), "qemu_mps2_an386", steps) == Flipped(steps, 0, 0, "")


@pytest.mark.parametrize("name", ["full pid, fixed16", "transfer_function, fixed32", "self_tuning, fixed16"])
def test_an_emulated_core_steps_from_random_states(name: str) -> None:
    assert on_core(_program(name), "qemu_mps2_an386", 2000) == Flipped(2000, 0, 0, "")


def _bare(program: Program) -> Program:
    """Read every state word as it is."""
    held = {op.result.name: op for op in program.body if op.result.name.endswith("_held")}
    body = tuple(
        op
        if op.result.name not in held
        else Op(replace(op.result, low=-(2**31), high=2**31 - 1), "copy", op.arguments[:1])
        for op in program.body
    )
    return replace(program, body=body)


def test_the_sanitizers_see_a_state_that_is_read_as_it_is() -> None:
    found = on_host(_bare(_program("full pid, fixed32")), STEPS)
    assert found.wrong and "overflow" in found.says and found.away


@pytest.mark.parametrize("name", sorted(NAMES))
@pytest.mark.parametrize("arithmetic", ["float32", "float64"])
def test_a_state_that_is_no_number_in_floats_leaves_the_outputs_in_range_and_is_gone_soon(
    name: str, arithmetic: str
) -> None:
    program = _program(f"{name}, {arithmetic}")
    count = 200 if program.tables else 2000
    random, kind = np.random.default_rng(1), np.dtype(arithmetic)
    inputs = [random.uniform(v.low, v.high, count).astype(kind) for v in program.inputs]
    lost = np.array([np.nan, np.inf, -np.inf], kind)
    state = [np.full(count, start, kind) for start in program.start]
    for j in range(len(program.state)):
        state[j] = np.where(random.random(count) < 0.5, lost[random.integers(0, 3, count)], state[j])
    machine = Machine(program)
    with np.errstate(all="ignore"):
        for _ in range(len(program.state) + 1):
            values = machine.step(inputs, state)
            for slot, output in zip(machine.results, program.outputs, strict=True):
                assert np.all((values[slot] >= output.low) & (values[slot] <= output.high))
            state = [np.broadcast_to(values[slot], count) for slot in machine.next]
    assert all(np.all(np.isfinite(column)) for column in state)
