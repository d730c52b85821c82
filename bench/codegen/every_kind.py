"""Prove the examples of every controller kind in every number format, on the host and on the emulated Cortex-M4F.

    python -m bench.codegen.every_kind         10^6 steps on the host, 10^5 on the M4F; `--quick` takes a tenth;
                                       names of examples take these alone

A format that a kind's example does not fit is told with the reason. Exit status 1 when anything differs.
"""

from __future__ import annotations

import sys
import time

from bench.codegen.proof import HOST_STEPS, TARGET_STEPS
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import QuantizeError
from firmloop.verify.run import verify


def main() -> int:
    """Print one line per kind, format and target."""
    share = 10 if "--quick" in sys.argv else 1
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")]
    print("kind                   format    target               steps  diff bound/worst instructions   text  wall s")
    wrong = 0
    examples = [(kind, *pair) for kind in kinds().values() for pair in kind.examples.items()]
    for kind, name, request in examples:
        if chosen and name not in chosen:
            continue
        law = kind.design(request).law
        for arithmetic in ARITHMETICS:
            try:
                program = lower(law, arithmetic)
            except QuantizeError as error:
                print(f"{name:22} {arithmetic:9} refused: {error}")
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
                    f"{name:22} {arithmetic:9} {target:16} {verdict.steps:>9,} {verdict.differences:>5} {ratio:>11} "
                    f"{count:>12} {text:>6} {time.perf_counter() - start:>7.1f}",
                    flush=True,
                )
                wrong += verdict.differences + sum(r.worst > r.bound for r in verdict.rounding)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
