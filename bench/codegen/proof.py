"""Prove one PID in every number format, on the host and on the emulated Cortex-M4F, and time the reference.

python -m bench.codegen.proof              10^6 steps on the host, 10^5 on the M4F, 10^7 of the reference alone
"""

from __future__ import annotations

import sys
import time

import numpy as np

from bench.codegen.example_laws import example_law
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.verify.reference import run
from firmloop.verify.run import verify
from firmloop.verify.scaling import to_raw
from firmloop.verify.verdict import Verdict

HOST_STEPS = 1_000_000
TARGET_STEPS = 100_000


def row(verdict: Verdict, arithmetic: str, seconds: float) -> str:
    """Return one line of the table."""
    (rounded,) = verdict.rounding
    cost = verdict.cost
    count = "-" if cost.instructions_max is None else f"{cost.instructions_min}-{cost.instructions_max}"
    text = "-" if cost.text_bytes is None else str(cost.text_bytes)
    return (
        f"{arithmetic:9} {verdict.target:16} {verdict.steps:>9,} {verdict.differences:>5} "
        f"{rounded.worst:>10.3g} {rounded.bound:>10.3g} {count:>12} {text:>6} {seconds:>6.1f}"
    )


def main() -> int:
    """Print both tables; the exit status is 1 when anything differs."""
    law = example_law()
    print("format    target               steps  diff    worst V    bound V instructions   text  wall s")
    wrong = 0
    for arithmetic in ARITHMETICS:
        program = lower(law, arithmetic)
        bundle = emit(program, "firmloop generate motor_pid.toml")
        for name, steps in (("host", HOST_STEPS), ("qemu_mps2_an386", TARGET_STEPS)):
            start = time.perf_counter()
            verdict = verify(law, program, bundle, load_target(name), (), steps, 1, None, lambda fraction, label: None)
            print(row(verdict, arithmetic, time.perf_counter() - start), flush=True)
            wrong += verdict.differences + sum(r.worst > r.bound for r in verdict.rounding)
    print("\nreference alone, 10,000 lanes of 1,000 steps (10^7):")
    for arithmetic in ARITHMETICS:
        program = lower(law, arithmetic)
        random = np.random.default_rng(1)
        columns = [to_raw(v, random.uniform(-400.0, 400.0, size=(10_000, 1_000))) for v in program.inputs]
        inputs = np.stack(columns, axis=-1)
        start = time.perf_counter()
        run(program, inputs)
        print(f"{arithmetic:9} {time.perf_counter() - start:6.1f} s", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
