"""Run every kind from states whose words hold random bits, under the sanitizers and on emulated cores.

    python -m bench.proofs.flipped_bits      10^6 steps a kind on the host, the M4F and the M0; `--quick` takes
                                             a hundredth, names of laws take these alone

The state stands among the inputs and outputs of the program, so that one step is compared bit for bit with the
reference and all it leaves is seen. Exit status 1 where a sanitizer speaks, a bit differs, an output leaves its range,
or a state is not back: in fixed point in its range after the step, in floating point a number after a few.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bench.codegen.example_laws import laws
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program, QuantizeError, Value
from firmloop.verify.block import Block, run_blocks
from firmloop.verify.build.image import build_image
from firmloop.verify.build.sanitized import compare_sanitized, run_sanitized
from firmloop.verify.compare import compare, record_type
from firmloop.verify.link import Hello, Link
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.proofs.any_state import opened
from firmloop.verify.reference import Trace

STEPS, LANES = 1_000_000, 1000
SOLVING = 1000  # times as many steps as one that solves has in the same time
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


def random_words(program: Program, steps: int, seed: int) -> tuple[Program, Block, Trace]:
    """Return one step of a floating-point `program`, any state and what becomes of it, and what the reference makes.

    Each state goes on for as many samples as `settled` says, the lanes of each after those of the one before.
    """
    step, random, kind = opened(replace(program, safe=())), np.random.default_rng(seed), np.dtype(program.arithmetic)
    rounds, own = settled(program), len(program.outputs)
    count = max(1, steps // rounds)
    state = [_odd(random, kind, count, value) for value in program.state]
    samples = []
    for _ in range(rounds):
        fresh = [random.uniform(v.low, v.high, count).astype(kind) for v in program.inputs]
        samples.append(np.stack([*fresh, *state], axis=-1))
        with np.errstate(all="ignore"):
            left = run_blocks(step, [Block("one", samples[-1][None])])[0]
        state = list(left.outputs[0, :, own:].T)
    block = Block("random state", np.stack(samples))
    with np.errstate(all="ignore"):
        return step, block, run_blocks(step, [block])[0]


def _odd(random: np.random.Generator, kind: np.dtype[Any], count: int, value: Value) -> NDArray[Any]:
    """Return words of random bits, usual ones with one bit turned, and what is no number, huge or tiny."""
    word = np.dtype(f"u{kind.itemsize}")
    limits = np.finfo(kind)
    edges = (np.nan, np.inf, -np.inf, -0.0, limits.max, limits.min, limits.tiny, limits.smallest_subnormal)
    usual = random.uniform(max(value.low, -1e9), min(value.high, 1e9), count).astype(kind)
    turned = usual.view(word) ^ (word.type(1) << random.integers(0, 8 * kind.itemsize, count).astype(word))
    anything = random.integers(0, np.iinfo(word).max, count, dtype=word, endpoint=True)
    pick = random.integers(0, 4, count)
    drawn = [anything.view(kind), turned.view(kind), np.array(edges, kind)[random.integers(0, len(edges), count)]]
    return np.select([pick == k for k in range(3)], drawn, usual)


def settled(program: Program) -> int:
    """Return the samples within which a state is of numbers again, where huge ones may first overflow."""
    return 2 * len(program.state) + 4


def drawn_states(program: Program, steps: int, seed: int) -> tuple[Program, Block, Trace]:
    """Return one step of `program`, inputs with any state, and what the reference makes of them."""
    return (random_states if program.arithmetic.startswith("fixed") else random_words)(program, steps, seed)


def on_host(program: Program, steps: int) -> Flipped:
    """Step under the sanitizers."""
    step, block, trace = drawn_states(program, steps, 1)
    bundle = emit(step, "firmloop generate project.toml")
    found = compare_sanitized(step, bundle, run_sanitized(step, bundle, [block]), [trace])
    says = found.undefined.says if found.undefined is not None else found.not_run
    return Flipped(found.steps, found.differences + (found.undefined is not None), away(program, trace), says)


def on_core(program: Program, target: str, steps: int) -> Flipped:
    """Step on an emulated core."""
    step, block, trace = drawn_states(program, steps, 2)
    core = load_target(target)
    with tempfile.TemporaryDirectory() as name:
        files = firmware(step, emit(step, "firmloop generate project.toml"), core, "semihosting")
        image = build_image(files, core, Path(name))
        with open_semihosting(core, image.elf, step.id) as link:
            one = replace(trace, outputs=_one_nan(trace.outputs))
            found = compare(step, OneNan(link, step), [block], [one], lambda part, label: None)
    return Flipped(found.steps, found.differences, away(program, trace), "")


def _one_nan(values: NDArray[Any]) -> NDArray[Any]:
    """Return the same values, all that are no number alike: which bits one has is each processor's own affair."""
    return values if values.dtype.kind != "f" else np.where(np.isnan(values), values.dtype.type(np.nan), values)


@dataclass(frozen=True, slots=True)
class OneNan:
    """A link on which all that is no number looks alike."""

    link: Link
    program: Program

    def hello(self) -> Hello:
        """Say what the link says."""
        return self.link.hello()

    def reset(self) -> None:
        """Reset as the link does."""
        self.link.reset()

    def step(self, inputs: bytes, count: int) -> bytes:
        """Step as the link does."""
        return self._alike(self.link.step(inputs, count))

    def lanes(self, inputs: bytes, lanes: int, steps: int) -> bytes:
        """Run lanes as the link does."""
        return self._alike(self.link.lanes(inputs, lanes, steps))

    def _alike(self, answers: bytes) -> bytes:
        found = np.frombuffer(answers, record_type(self.program)).copy()
        for name in found.dtype.names or ():
            found[name] = _one_nan(found[name])
        return found.tobytes()

    def close(self) -> None:
        """Close the link."""
        self.link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *of: object) -> None:
        self.close()


def away(program: Program, trace: Trace) -> int:
    """Return in how many steps an output or a state was not where it has to be afterwards."""
    outputs, state = trace.outputs[..., : len(program.outputs)], trace.outputs[..., len(program.outputs) :]
    out = _outside(outputs, program.outputs)
    if program.arithmetic.startswith("fixed"):
        return int(np.count_nonzero(out | _outside(state, program.state)))
    out |= (trace.status >> program.status[-1].bit & 1) != 0  # no input is lost
    out[-1] |= ~np.all(np.isfinite(state[-1]), axis=-1)
    return int(np.count_nonzero(out))


def _outside(columns: NDArray[Any], values: Sequence[Value]) -> NDArray[np.bool_]:
    low, high = (np.array([getattr(value, end) for value in values]) for end in ("low", "high"))
    return np.asarray(np.any(~((columns >= low) & (columns <= high)), axis=-1))


def programs(chosen: Mapping[str, Law], arithmetics: Sequence[str]) -> dict[str, Program]:
    """Return every program with a state that a law has in these formats."""
    found = {}
    for name, law in chosen.items():
        for arithmetic in arithmetics:
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
    for name, program in programs({k: v for k, v in laws().items() if not chosen or k in chosen}, ARITHMETICS).items():
        share = SOLVING if program.tables else 1
        for target in ("host", *CORES):
            start = time.perf_counter()
            found = on_host(program, steps // share) if target == "host" else on_core(program, target, steps // share)
            seconds = time.perf_counter() - start
            print(f"{name:28} {target:16} {found.steps:>9,} {found.wrong:6} {found.away:13} {seconds:7.1f}", flush=True)
            if found.says:
                print(f"    {found.says}")
            wrong += found.wrong + found.away + (found.steps == 0)
    print(f"{wrong} steps wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
