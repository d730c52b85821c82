"""Golden vectors as CSV: what the controller reads and answers, step by step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmloop.codegen.delivery import Delivery
from firmloop.quantize.program import Value


def golden_vectors(delivery: Delivery) -> Mapping[str, str]:
    """Return `test/vectors.csv`: one row a step, integers in fixed point, hexadecimal floats in floating point.

    `start` is 1 where init() comes before the step.
    """
    program = delivery.program
    names = ["start", *(v.name for v in (*program.inputs, *program.parameters, *program.outputs)), "status"]
    lines = [",".join(names)]
    for start, row_in, row_set, row_out, word in delivery.rows():
        cells = [_text(v, x) for v, x in zip(program.inputs, row_in, strict=True)]
        cells += [_text(v, x) for v, x in zip(program.parameters, row_set, strict=True)]
        cells += [_text(v, x) for v, x in zip(program.outputs, row_out, strict=True)]
        lines.append(",".join([str(start), *cells, str(word)]))
    return {"test/vectors.csv": "\n".join(lines) + "\n"}


def _text(value: Value, x: Any) -> str:
    return float(x).hex() if value.number.kind == "float" else str(int(x))


FILES = golden_vectors
