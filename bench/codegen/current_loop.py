"""Measure the current loop of `examples/pmsm_foc` in three number formats, each figure beside its bar.

    python -m bench.codegen.current_loop [PART ...] [--steps N] [--target NAME ...]

    cost     instructions of a step on the Cortex-M4F at -O2, text, RAM and stack; the duties' proven bound and worst
    cores    differences on this machine and on every emulated core, 10^5 steps each
    judges   no overflow from any state: by intervals, by z3 and, where it is installed, by ESBMC on the C
    step     i_q stepped by 3 A at 20 kHz with a bandwidth of 2 kHz: overshoot, and what i_d moves

Without a PART all are measured. RAM is the instance, which the caller holds, and what the controller's files hold of
their own. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.codegen.every_target import emulated
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.target import Target, load_target
from firmloop.design.law import Law
from firmloop.identify.simulation.compiler import ToolError
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.stages.making import design
from firmloop.stages.plant import plant_of
from firmloop.verify.judgement import PROVEN
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import every_judge
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.run import verify
from firmloop.verify.verdict import Verdict
from tests.verify.test_current_loop import stepped

PROJECT = Path(__file__).parents[2] / "examples" / "pmsm_foc" / "spindle.toml"
COMMAND = "firmloop generate spindle.toml"
FORMATS = ("float32", "fixed32", "fixed16")
STEPS = 100_000
M4F = "qemu_mps2_an386"
INSTRUCTIONS = {"float32": 330, "fixed32": 420, "fixed16": 360}  # of the costliest step
TEXT, RAM = 1600, 64  # bytes
BOUND = {"fixed32": 1e-6, "fixed16": 1e-3}  # of a duty
JUDGES = ("intervals", "z3", "esbmc")
STEP = 3.0  # A
OVERSHOOT, CROSS = 0.05, 0.03  # of the step


def spindle() -> Law:
    """Return the law of the example's project."""
    project = read_project(PROJECT)
    return design(project, plant_of(project)).law


def measured(arithmetic: str, target: Target, steps: int) -> Verdict:
    """Run the C against the reference."""
    law = spindle()
    program = lower(law, arithmetic)
    return verify(law, program, emit(program, COMMAND), target, (), steps, 1, None, lambda share, doing: None)


def cost(steps: int, targets: Sequence[str]) -> int:
    """Print what a step costs and how closely the duties follow the law."""
    print("format    target             least  most   bar  text   RAM  stack      worst      bound  differences")
    missed = 0
    for arithmetic in FORMATS:
        held = sum(value.number.bits // 8 for value in lower(spindle(), arithmetic).state)
        for name in targets or (M4F,):
            found = measured(arithmetic, load_target(name), steps)
            spent = found.cost
            ram = held + (spent.data_bytes or 0) + (spent.bss_bytes or 0)
            worst, bound = (max(getattr(r, key) for r in found.rounding) for key in ("worst", "bound"))
            least, most = spent.instructions_min or 0.0, spent.instructions_max or 0.0
            print(
                f"{arithmetic:9} {name:16} {least:7.0f} {most:5.0f} {INSTRUCTIONS[arithmetic]:5} {spent.text_bytes:5} "
                f"{ram:5} {spent.stack_bytes!s:>6} {worst:10.3g} {bound:10.3g} {found.differences:12}",
                flush=True,
            )
            if name == M4F:
                missed += (most > INSTRUCTIONS[arithmetic]) + ((spent.text_bytes or 0) > TEXT) + (ram > RAM)
            missed += (worst > bound) + (bound > BOUND.get(arithmetic, math.inf)) + (found.differences > 0)
    return missed


def cores(steps: int, targets: Sequence[str]) -> int:
    """Print how many values differ on each core."""
    missed = 0
    known = {target.name: target for target in (load_target("host"), *emulated())}
    for name in targets or known:
        for arithmetic in FORMATS:
            begin = time.perf_counter()
            try:
                found = measured(arithmetic, known[name], steps)
            except ToolError as error:
                print(f"{name:24} not run: {error}")
                break
            print(
                f"{name:24} {arithmetic:8} {found.steps:9,} steps {found.differences:3} differences "
                f"{time.perf_counter() - begin:6.1f} s",
                flush=True,
            )
            missed += found.differences > 0
    return missed


def judges(steps: int, targets: Sequence[str]) -> int:
    """Print what each judge says of the words in fixed point, and the intervals alone of floating point."""
    missed = 0
    for arithmetic in FORMATS:
        law = spindle()
        program = lower(law, arithmetic)
        claims = read_claims(json.loads(json.dumps(proof(program, law.reasons))))
        for name in JUDGES:
            judge = every_judge()[name]
            with tempfile.TemporaryDirectory() as folder:
                write_files(emit(program, COMMAND).files, Path(folder))
                said = judge.judge(Delivered(claims, Path(folder)))
            print(f"{arithmetic:9} {name:10} {said.result}, {said.seconds:.1f} s {said.says[:200]}", flush=True)
            missed += judge.version() is not None and claims.fixed and said.result != PROVEN
    return missed


def step(steps: int, targets: Sequence[str]) -> int:
    """Print the step of i_q; duties that act at once, at rest and while the rotor turns."""
    missed = 0
    for arithmetic in FORMATS:
        for speed in (0.0, 500.0):
            seen, _ = stepped(arithmetic, speed, STEP, 0, bandwidth_rad_s=2 * math.pi * 2000.0)
            after = seen[400:]
            over = np.max(after.imag) / STEP - 1.0
            cross = np.max(np.abs(after.real)) / STEP
            reached = int(np.argmax(after.imag >= 0.9 * STEP))
            print(f"{arithmetic:9} {speed:5.0f} rad/s: 90 % after {reached} periods, {over:.2%} over, i_d {cross:.2%}")
            missed += (over > OVERSHOOT) + (cross > CROSS)
    return missed


PARTS = {"cost": cost, "cores": cores, "judges": judges, "step": step}


def main() -> int:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], metavar="PART")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--target", action="append", default=[])
    arguments = parser.parse_args()
    missed = sum(PARTS[part](arguments.steps, arguments.target) for part in arguments.parts or PARTS)
    print(f"{missed} bars missed")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
