"""Measure the ways in which a predictive controller finds its moves, on one small servo: instructions, sizes, accuracy.

    python -m bench.mpc.methods

One row a solver and number, on 300 random states each on the emulated M4F, the optimum in double precision beside it.
Exit status 1 when a bit differs from the reference.
"""

from __future__ import annotations

import sys

import numpy as np

from bench.mpc.cart_pole import _on_target
from firmloop.codegen.emit import emit
from firmloop.design.kinds import design
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.twins.qp import optimum
from firmloop.verify.block import Block
from firmloop.verify.reference import run

RANGES = (("angle", "rad", 3.0), ("speed", "rad/s", 40.0))
LIMIT = 6.0  # V
TABLE = {
    "A": [[1.0, 0.009612], [0.0, 0.923116]], "B": [[0.002908], [0.57663]], "Q": [200.0, 0.1], "R": 0.01, "horizon": 5,
}  # fmt: skip
ROWS = (("online", "float32"), ("explicit", "float32"), ("explicit", "fixed32"), ("fixed_iterations", "float32"),
        ("fixed_iterations", "fixed32"), ("fixed_iterations", "fixed16"))  # fmt: skip


def measure(solver: str, arithmetic: str) -> int:
    """Print one row; return the differences."""
    inputs = tuple(Signal(name, unit, -size, size) for name, unit, size in RANGES)
    outputs = (Signal("voltage", "V", -LIMIT, LIMIT),)
    law = design("mpc", "servo", {**TABLE, "solver": solver}, 0.01, inputs, outputs, None, optimum).law
    program = lower(law, arithmetic)
    random = np.random.default_rng(1)
    states = random.uniform(-1, 1, (300, 2)) * [size for *_, size in RANGES] * random.uniform(0, 1, (300, 1))
    scale = np.array([2.0**value.number.fraction for value in program.inputs])
    kind = np.float32 if arithmetic == "float32" else np.dtype(f"int{arithmetic[5:]}").type
    block = Block("random", (states * scale).astype(kind)[:, None])
    trace = run(program, block.inputs)
    counts, differences, _, sizes = _on_target(program, emit(program, "bench.mpc.methods"), [block], [trace])
    assert law.solve is not None
    best = np.clip(optimum(law.solve.quadratic, block.inputs[:, 0] / scale).moves[:, 0], -LIMIT, LIMIT)
    away = np.abs(trace.outputs[:, 0, 0] * 2.0 ** -program.outputs[0].number.fraction - best)
    print(
        f"{solver:17} {arithmetic:8} median {np.median(counts):,.0f}, worst {counts.max():,} instructions; "
        f"worst error {away.max():.2g} V; flash, stack, static {sizes}; {differences} differences"
    )
    return differences


def main() -> int:
    """Measure every row."""
    return 1 if sum(measure(*row) for row in ROWS) else 0


if __name__ == "__main__":
    sys.exit(main())
