"""Set the proven bound on |program - law| against the worst that adversarial inputs reach, per kind and format.

    python -m bench.bounds              10^6 steps each; `--quick` takes a twentieth

The inputs are the L1-worst one of every output and state, full-scale squares, chirps and long saturation, and as many
steps of tracking noise, which is what makes roundings add up. Exit status 1 when a bound is passed.
"""

from __future__ import annotations

import sys
import time

from bench.proof import HOST_STEPS
from design.kinds import kinds
from design.law import Law
from quantize.lower import ARITHMETICS, lower
from quantize.program import QuantizeError
from verify.rounding import measure_rounding
from verify.stimuli import adversarial, run_blocks, stimuli
from verify.verdict import Rounded

QUICK = 20
SEED = 1


def worst(law: Law, arithmetic: str, steps: int) -> tuple[Rounded, ...]:
    """Return bound and worst of every output over `steps` steps, half of them adversarial."""
    program = lower(law, arithmetic)
    blocks = adversarial(program, steps // 2, SEED) + stimuli(program, [], steps // 2, SEED)
    return measure_rounding(law, program, blocks, run_blocks(program, blocks))


def main() -> int:
    """Print one line per kind, format and output."""
    steps = HOST_STEPS // (QUICK if "--quick" in sys.argv else 1)
    print("kind              format    output          bound      worst bound/worst  wall s")
    passed = 0
    for name, kind in kinds().items():
        law = kind.design(kind.example).law
        for arithmetic in ARITHMETICS:
            start = time.perf_counter()
            try:
                found = worst(law, arithmetic, steps)
            except QuantizeError as error:
                print(f"{name:17} {arithmetic:9} refused: {error}")
                continue
            seconds = time.perf_counter() - start
            for r in found:
                ratio = f"{r.bound / r.worst:.3g}" if r.worst > 0.0 else "-"
                line = f"{name:17} {arithmetic:9} {r.output:10} {r.bound:>10.3g} {r.worst:>10.3g} {ratio:>11}"
                print(f"{line} {seconds:7.1f}", flush=True)
                passed += r.worst > r.bound
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
