"""Prove one example of every controller kind in every number format, on the host and on the emulated Cortex-M4F.

    python -m bench.every_kind         10^6 steps on the host, 10^5 on the M4F; `--quick` takes a tenth

A format that a kind's example does not fit is told with the reason. Exit status 1 when anything differs.
"""

from __future__ import annotations

import sys
import time

from bench.proof import HOST_STEPS, TARGET_STEPS
from codegen.emit import emit
from codegen.target import load_target
from design.kinds import kinds
from quantize.lower import ARITHMETICS, lower
from quantize.program import QuantizeError
from verify.run import verify


def main() -> int:
    """Print one line per kind, format and target."""
    share = 10 if "--quick" in sys.argv else 1
    print("kind              format    target               steps  diff bound/worst instructions   text  wall s")
    wrong = 0
    for name, kind in kinds().items():
        law = kind.design(kind.example).law
        for arithmetic in ARITHMETICS:
            try:
                program = lower(law, arithmetic)
            except QuantizeError as error:
                print(f"{name:17} {arithmetic:9} refused: {error}")
                continue
            bundle = emit(program, f"firmloop generate {law.name}.toml")
            for target, steps in (("host", HOST_STEPS // share), ("qemu_mps2_an386", TARGET_STEPS // share)):
                start = time.perf_counter()
                verdict = verify(
                    law, program, bundle, load_target(target), (), steps, 1, None, lambda part, label: None
                )
                ratios = [r.bound / r.worst for r in verdict.rounding if r.worst > 0.0]
                ratio = f"{max(ratios):.3g}" if ratios else "-"
                cost = verdict.cost
                count = "-" if cost.instructions_max is None else f"{cost.instructions_min}-{cost.instructions_max}"
                text = "-" if cost.text_bytes is None else str(cost.text_bytes)
                print(
                    f"{name:17} {arithmetic:9} {target:16} {verdict.steps:>9,} {verdict.differences:>5} {ratio:>11} "
                    f"{count:>12} {text:>6} {time.perf_counter() - start:>7.1f}",
                    flush=True,
                )
                wrong += verdict.differences + sum(r.worst > r.bound for r in verdict.rounding)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
