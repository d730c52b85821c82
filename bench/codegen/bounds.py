"""Set the proven bound on |program - law| against the worst that adversarial inputs reach, per kind and format.

    python -m bench.codegen.bounds      10^6 steps each; `--quick` takes a twentieth; names of examples take these alone

The inputs are the L1-worst one of every output and state, full-scale squares, chirps and long saturation, and as many
steps of tracking noise, which is what makes roundings add up. Exit status 1 when a bound is passed, or misses its bar.
"""

from __future__ import annotations

import math
import sys
import time

from bench.codegen.proof import HOST_STEPS
from firmloop.design.kinds import kinds
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import QuantizeError
from firmloop.verify.block import run_blocks
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.stimuli.stimuli import adversarial, stimuli
from firmloop.verify.verdict import Rounded

QUICK = 20
BARS = {"pid": 3.0, "transfer_function": 10.0}  # bound over worst; the latter is of fourth order
SEED = 1


def worst(law: Law, arithmetic: str, steps: int) -> tuple[Rounded, ...]:
    """Return bound and worst of every output over `steps` steps, half of them adversarial."""
    program = lower(law, arithmetic)
    blocks = adversarial(program, steps // 2, SEED) + stimuli(program, [], steps // 2, SEED)
    return measure_rounding(law, program, blocks, run_blocks(program, blocks))


def main() -> int:
    """Print one line per example, format and output."""
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")]
    steps = HOST_STEPS // (QUICK if "--quick" in sys.argv else 1)
    print("law                    format    output          bound      worst bound/worst  wall s")
    passed = 0
    examples = [(name, kind, request) for kind in kinds().values() for name, request in kind.examples.items()]
    for name, kind, request in examples:
        if chosen and name not in chosen:
            continue
        law = kind.design(request).law
        for arithmetic in ARITHMETICS:
            start = time.perf_counter()
            try:
                found = worst(law, arithmetic, steps)
            except QuantizeError as error:
                print(f"{name:22} {arithmetic:9} refused: {error}")
                continue
            seconds = time.perf_counter() - start
            for r in found:
                ratio = r.bound / r.worst if r.worst > 0.0 else None
                shown = "-" if ratio is None else f"{ratio:.3g}"
                line = f"{name:22} {arithmetic:9} {r.output:10} {r.bound:>10.3g} {r.worst:>10.3g} {shown:>11}"
                print(f"{line} {seconds:7.1f}", flush=True)
                passed += r.worst > r.bound
                passed += ratio is not None and ratio > BARS.get(name, math.inf)
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
