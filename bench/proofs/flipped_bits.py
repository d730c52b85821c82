"""Run every fixed-point kind from states whose words hold random bits, under the sanitizers and on emulated cores.

    python -m bench.proofs.flipped_bits      10^6 steps a kind on the host, the M4F and the M0; `--quick` takes
                                             a hundredth, names of laws take these alone

The state stands among the inputs and outputs of the program, so that one step is compared bit for bit with the
reference and all it leaves is seen. Exit status 1 where a sanitizer speaks, a bit differs, or a state is not back in
its range after the step.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.codegen.example_laws import laws
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program, QuantizeError, Value
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.image import build_image
from firmloop.verify.build.sanitized import run_sanitized
from firmloop.verify.compare import compare
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.proofs.any_state import opened
from firmloop.verify.reference import Trace

STEPS, LANES = 1_000_000, 1000
CORES = ("qemu_mps2_an386", "qemu_microbit")


@dataclass(frozen=True, slots=True)
class Flipped:
    """What a run from random states found: how many steps, values apart or undefined, states left out of range."""

    steps: int
    wrong: int
    away: int
    says: str


def one_step(program: Program) -> Program:
    """Return one step with the state among inputs and outputs, all of them in words of 32 bits."""
    step = opened(program)
    return replace(step, inputs=tuple(map(_word, step.inputs)), outputs=tuple(map(_word, step.outputs)))


def _word(value: Value) -> Value:
    return replace(value, number=replace(value.number, bits=32))


def random_states(program: Program, steps: int, seed: int) -> tuple[Program, Block, Trace]:
    """Return one step of `program`, raw inputs with any state, and what the reference makes of them."""
    step, random = one_step(program), np.random.default_rng(seed)
    lanes = min(LANES, steps)
    halves = [2 ** (v.number.bits - 1) for v in (*program.inputs, *program.state)]
    columns = [random.integers(-half, half, size=(lanes, steps // lanes)).astype(np.int32) for half in halves]
    for k, column in enumerate(columns[len(program.inputs) :], len(program.inputs)):  # one bit of a usual state
        value = step.inputs[k]
        usual = random.integers(int(value.low), int(value.high) + 1, size=column.shape)
        flipped = usual ^ (np.int64(1) << random.integers(0, 32, size=column.shape))
        columns[k] = np.where(random.random(column.shape) < 0.5, flipped.astype(np.int32), column)
    block = Block("random state", np.stack(columns, axis=-1))
    return step, block, run_blocks(step, [block])[0]


def on_host(program: Program, steps: int) -> Flipped:
    """Step under the sanitizers."""
    step, block, trace = random_states(program, steps, 1)
    found = run_sanitized(step, emit(step, "firmloop generate project.toml"), [block], [trace])
    says = found.undefined.says if found.undefined is not None else found.not_run
    return Flipped(found.steps, found.differences + (found.undefined is not None), away(program, trace), says)


def on_core(program: Program, target: str, steps: int) -> Flipped:
    """Step on an emulated core."""
    step, block, trace = random_states(program, steps, 2)
    core = load_target(target)
    with tempfile.TemporaryDirectory() as name:
        files = firmware(step, emit(step, "firmloop generate project.toml"), core, "semihosting")
        image = build_image(files, core, Path(name))
        with open_semihosting(core, image.elf, step.id) as link:
            found = compare(step, link, [block], [trace], lambda part, label: None)
    return Flipped(found.steps, found.differences, away(program, trace), "")


def away(program: Program, trace: Trace) -> int:
    """Return in how many steps an output or a state was out of its range afterwards."""
    values = (*program.outputs, *program.state)
    out = [(trace.outputs[..., k] < v.low) | (trace.outputs[..., k] > v.high) for k, v in enumerate(values)]
    return int(np.count_nonzero(np.any(out, axis=0)))


def fixed_programs(chosen: Mapping[str, Law]) -> dict[str, Program]:
    """Return every program with a state that a law has in fixed point."""
    found = {}
    for name, law in chosen.items():
        for arithmetic in ("fixed32", "fixed16"):
            try:
                program = lower(law, arithmetic)
            except QuantizeError:
                continue
            if program.state:
                found[f"{name}, {arithmetic}"] = program
    return found


def main() -> int:
    """Print one line a program and machine."""
    chosen = [word for word in sys.argv[1:] if word != "--quick"]
    steps = STEPS // (100 if "--quick" in sys.argv else 1)
    wrong = 0
    print("program                      machine              steps  wrong  out of range  wall s")
    for name, program in fixed_programs({k: v for k, v in laws().items() if not chosen or k in chosen}).items():
        for target in ("host", *CORES):
            start = time.perf_counter()
            found = on_host(program, steps) if target == "host" else on_core(program, target, steps)
            seconds = time.perf_counter() - start
            print(f"{name:28} {target:16} {found.steps:>9,} {found.wrong:6} {found.away:13} {seconds:7.1f}", flush=True)
            if found.says:
                print(f"    {found.says}")
            wrong += found.wrong + found.away + (found.steps == 0)
    print(f"{wrong} steps wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
