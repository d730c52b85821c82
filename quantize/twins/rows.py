"""Add up rows of sums bit for bit: the twin of fl_rows.h."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Table

Raw = NDArray[Any]


def ready(table: Table, kind: np.dtype[Any]) -> Raw:
    """Make a table ready for `run`: its weights (values, rows)."""
    (_, weights), *_ = table.numbers
    return np.array(weights, dtype=kind).reshape(dict(table.sizes)["FL_ROW_VALUES"], -1)


def run(weights: Raw, *values: Any) -> Raw:
    """Return one row each, a column a lane."""
    with np.errstate(all="ignore"):
        total = weights[0, :, None] * values[0]
        for column, value in zip(weights[1:], values[1:], strict=True):
            total = total + column[:, None] * value
    return np.asarray(total)
