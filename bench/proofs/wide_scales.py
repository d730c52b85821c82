"""Run random fixed-point laws over twelve decades of scale against their C, under the sanitizers.

    python -m bench.proofs.wide_scales [LAWS] [SEED]          500 laws of seed 12 by default; `--core` runs each on
                                                              an emulated Cortex-M4F, too

Signals, gains and limits are each drawn from 1e-6 to 1e6 times those of `random_laws.py` and of every example,
both words, both roundings. A law that design or quantize refuses is counted with its reason and drawn again. Exit
status 1 when a value differs between the reference and the C, a sanitizer reports, a shift is as wide as its word, an
operation is not proven, or an output is farther from the law than its bound.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.proofs.random_laws import KINDS, Draw, Random, Table
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.design import Kind, Request
from firmloop.design.kinds import design, kinds
from firmloop.design.law import DesignError, Law
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program, QuantizeError
from firmloop.quantize.proof import proof
from firmloop.verify.block import Block, side_by_side
from firmloop.verify.build.image import build_image
from firmloop.verify.build.sanitized import compare_sanitized, run_sanitized
from firmloop.verify.compare import compare
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.proofs.checker import ProofError, check_proof
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli

LAWS = 500
SEED = 12
CORE = "qemu_mps2_an386"
DECADES = 6.0  # to either side
STEPS, LENGTH = 2000, 100
GAINS = ("kp", "ki", "kd", "C", "D", "numerator", "gain")
SPAN = 400.0  # rad/s, of the signals that `bench.proofs.random_laws` draws its points for
SHIFT = re.compile(r"\bfl_(?:shl|shr|asr)_i32\(.*, (\d+)U\)")
LONG_SHIFT = re.compile(r"\bfl_(?:mul_shift|mul_down|high|down)_i32\(.*, (\d+)U\)|\bFL_SHIFT_\w+ = (-?\d+)")


@dataclass(frozen=True, slots=True)
class Format:
    """A fixed-point word, and what is done with the places that it drops."""

    arithmetic: str
    rounds: str


FORMATS = tuple(Format(word, rounds) for rounds in ("nearest", "floor") for word in ("fixed32", "fixed16"))


def wide_draws(seed: int) -> Iterator[Draw]:
    """Draw laws of every kind in turn, and the examples of every kind at other scales, without end."""
    random = np.random.default_rng(seed)
    every = [(kind, request) for kind in kinds().values() for request in kind.examples.values()]
    while True:
        for name, table in KINDS:
            yield _drawn(random, name, table)
        yield _rescaled(random, *every[int(random.integers(len(every)))])


def _drawn(random: Random, kind: str, table: Callable[[Random], Table]) -> Draw:
    span, limit = _decades(random), _decades(random)
    matched = limit / span * float(10.0 ** random.uniform(-3, 1))
    gain = matched if random.random() < 0.5 else _decades(random)
    wires = tuple(Signal(name, "rad/s", -span, span) for name in ("reference", "measurement"))
    output = (Signal("output", "V", -limit, limit * random.uniform(0.1, 1.0)),)
    try:
        law = design(kind, "random_law", scaled(table(random), gain, span / SPAN), 0.001, wires, output, None).law
    except DesignError as error:
        return Draw(kind, None, str(error))
    return Draw(kind, law, "")


def _rescaled(random: Random, kind: Kind, request: Request) -> Draw:
    def times(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
        return tuple(replace(s, low=s.low * x, high=s.high * x) for s in signals for x in (_decades(random),))

    name = f"example of {request.name}"
    try:
        return Draw(name, kind.design(replace(request, inputs=times(request.inputs))).law, "")
    except DesignError as error:
        return Draw(name, None, str(error))


def scaled(table: Table, gain: float, span: float) -> Table:
    """Return a table with gains so many times as large, and points of a schedule, also of all controllers in it."""
    found = dict(table)
    for key in GAINS:
        if key in found:
            found[key] = (np.asarray(found[key], dtype=float) * gain).tolist()
    if "ranges" in found:
        found["ranges"] = {key: [x * gain for x in ends] for key, ends in dict(found["ranges"]).items()}  # type: ignore[call-overload]
    if "points" in found:
        found["points"] = [x * span for x in list(found["points"])]  # type: ignore[call-overload]
    if "controllers" in found:
        found["controllers"] = [scaled(one, gain, span) for one in list(found["controllers"])]  # type: ignore[call-overload]
    return found


def _decades(random: Random) -> float:
    return float(10.0 ** random.uniform(-DECADES, DECADES))


def wide_shifts(source: str) -> list[str]:
    """Return the shifts in C that are as wide as the word they act on, or wider."""
    found = [match[0] for match in SHIFT.finditer(source) if not 0 <= int(match[1]) < 32]
    long = [match[0] for match in LONG_SHIFT.finditer(source) if not 0 < int(match[1] or match[2]) < 64]
    return found + long


def faults_of(law: Law, program: Program) -> list[str]:
    """Say all that is wrong with a program, its proof and its C."""
    bundle = emit(program, "python -m bench.proofs.wide_scales")
    found = [f"shift as wide as its word: {text}" for text in wide_shifts("\n".join(bundle.files.values()))]
    try:
        check_proof(json.loads(json.dumps(proof(program, law.reasons))))
    except ProofError as error:
        found.append(f"not proven: {error}")
    block = _block(program)
    trace = run(program, block.inputs, block.settings)
    try:
        done = compare_sanitized(program, bundle, run_sanitized(program, bundle, [block]), [trace])
        found += [done.undefined.sentence()] if done.undefined else []
        found += [f"{done.differences} differences in {done.steps} steps"] if done.differences else []
        found += [done.not_run] if done.not_run else []
    except ToolError as error:
        found.append(str(error))
    for rounded in measure_rounding(law, program, [block], [trace]):
        if not rounded.worst <= rounded.bound:
            found.append(f"{rounded.output} is {rounded.worst:g} {rounded.unit} off the law, bound {rounded.bound:g}")
    return found


def faults_on_core(program: Program) -> list[str]:
    """Say what an emulated Cortex-M4F does otherwise than the reference, from the same C."""
    core, block = load_target(CORE), _block(program)
    trace = run(program, block.inputs, block.settings)
    with tempfile.TemporaryDirectory() as name:
        files = firmware(program, emit(program, "python -m bench.proofs.wide_scales"), core, "semihosting")
        image = build_image(files, core, Path(name))
        with open_semihosting(core, image.elf, program.id) as link:
            done = compare(program, link, [block], [trace], lambda part, label: None)
    return [f"{CORE}: {done.differences} differences in {done.steps} steps"] if done.differences else []


def _block(program: Program) -> Block:
    """Return lanes of one length: no lane needs a program of its own."""
    long = [b for b in stimuli(program, [], STEPS, SEED) if b.inputs.shape[1] >= LENGTH]
    cut = [Block(b.name, b.inputs[:, :LENGTH], None if b.settings is None else b.settings[:, :LENGTH]) for b in long]
    return side_by_side(cut)


def main() -> int:
    """Print a line per kind, every fault, and every refusal once."""
    on_core = "--core" in sys.argv
    asked = [int(word) for word in sys.argv[1:] if word != "--core"]
    wanted, seed = (asked + [LAWS, SEED][len(asked) :])[:2]
    programs: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    failed, start = 0, time.perf_counter()
    for draw in wide_draws(seed):
        if programs.total() >= wanted:
            break
        if draw.law is None:
            refused[f"design: {_shape(draw.refused)}"] += 1
            continue
        form = FORMATS[(programs.total() + refused.total()) % len(FORMATS)]
        try:
            program = lower(draw.law, form.arithmetic, form.rounds)
        except QuantizeError as error:
            refused[f"quantize: {_shape(str(error))}"] += 1
            continue
        programs[draw.kind] += 1
        for fault in faults_of(draw.law, program) + (faults_on_core(program) if on_core else []):
            failed += 1
            print(f"{draw.kind} {form.arithmetic} {form.rounds}, law {programs.total()}: {fault}", flush=True)
    for kind, count in programs.most_common():
        print(f"{kind:36} {count:4} programs")
    print(f"{programs.total()} programs, {failed} faults: {time.perf_counter() - start:.0f} s")
    for reason, count in refused.most_common():
        print(f"  refused {count}: {reason}")
    return 1 if failed else 0


def _shape(reason: str) -> str:
    """Return a reason without its numbers, so that alike ones are counted together."""
    return re.sub(r"-?\d[\d.e+-]*", "#", reason)


if __name__ == "__main__":
    sys.exit(main())
