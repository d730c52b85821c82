"""Prove a PID whose five parameters are changed in mid-run, in every number format, on the host and on the M4F.

python -m bench.codegen.tunable              10^6 steps on the host, 10^5 on the M4F; `--quick` takes a tenth
"""

from __future__ import annotations

import json
import sys
import time

from bench.codegen.proof import HOST_STEPS, TARGET_STEPS, row
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.run import verify

RANGES = {"kp": [0.0, 0.2], "ki": [0.0, 5.0], "kd": [0.0, 0.001], "b": [0.0, 1.0], "c": [0.0, 1.0]}
TABLE = {
    **{"kp": 0.05, "ki": 1.4, "kd": 0.0004, "tf_s": 0.01, "tt_s": 0.05, "b": 0.7, "c": 0.2},
    **{"tunable": list(RANGES), "ranges": RANGES},
}


def main() -> int:
    """Print one line per format and target; the exit status is 1 when anything differs."""
    share = 10 if "--quick" in sys.argv else 1
    inputs = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
    law = design("pid", "motor_pid", TABLE, 0.001, inputs, (Signal("output", "V", -12.0, 12.0),), None).law
    print("format    target               steps  diff    worst V    bound V instructions   text  wall s")
    wrong = 0
    for arithmetic in ARITHMETICS:
        program = lower(law, arithmetic)
        bundle = emit(program, "firmloop generate motor_pid.toml")
        for name, steps in (("host", HOST_STEPS // share), ("qemu_mps2_an386", TARGET_STEPS // share)):
            start = time.perf_counter()
            verdict = verify(law, program, bundle, load_target(name), (), steps, 1, None, lambda fraction, label: None)
            print(row(verdict, arithmetic, time.perf_counter() - start), flush=True)
            wrong += verdict.differences + sum(r.worst > r.bound for r in verdict.rounding)
        checked = check_proof(json.loads(json.dumps(proof(program, law.reasons))))
        if checked is not None:
            print(
                f"          {checked.operations} operations and {checked.stores} stores proven again by z3", flush=True
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
