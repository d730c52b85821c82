"""Follow the tree of a quadratic program bit for bit: the twins of fl_tree.h and fl_tree_i32.h.

`q` holds the members and the sizes of the structure there; a row of a plane or a law has its offset last.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.outcome import INFEASIBLE, SOLVED
from firmloop.quantize.program import Table

Raw = NDArray[Any]

ONE = 1 << 30  # what stands for 1 beside the parameters in fixed point


def ready(table: Table, kind: np.dtype[Any]) -> dict[str, Any]:
    """Make a table ready for `run`: planes and laws as arrays of `kind`."""
    sizes, numbers = dict(table.sizes), dict(table.numbers)
    width = sizes["FL_QP_PARAMETERS"] + 1
    found: dict[str, Any] = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    found["plane"] = found["plane"].reshape(-1, width)
    found["law"] = found["law"].reshape(-1, sizes["FL_QP_MOVES"], width)
    found["below"], found["above"] = (np.array(numbers[key], dtype=np.int64) for key in ("below", "above"))
    return found | sizes


def run(q: dict[str, Any], *parameters: Any) -> Raw:
    """Return the moves, then the status, one row each, a column a lane."""
    p = np.stack(np.broadcast_arrays(*(np.atleast_1d(x) for x in parameters)), axis=-1)
    node = np.zeros(len(p), dtype=np.int64)
    with np.errstate(all="ignore"):
        for _ in range(q["FL_TREE_DEPTH"]):
            here = np.flatnonzero(node >= 0)
            side = _sum(q["plane"][node[here]], p[here]) > 0
            node[here] = np.where(side, q["above"][node[here]], q["below"][node[here]])
        law = -1 - node
        moves = np.stack([_sum(q["law"][law, k], p) for k in range(q["FL_QP_MOVES"])])
    if p.dtype.kind != "f":
        shift = q["FL_SHIFT_LAW"]
        rounded = (moves + (1 << (shift - 1))) >> shift
        moves = np.clip(rounded, q["least"][:, None], q["most"][:, None])
    status = np.where(law == q["FL_TREE_LAWS"] - 1, INFEASIBLE, SOLVED)
    return np.vstack([moves, status.astype(p.dtype)])


def _sum(rows: Raw, p: Raw) -> Raw:
    """Return each row's sum over (p, 1)."""
    total: Raw = rows[:, -1] if p.dtype.kind == "f" else rows[:, -1] * ONE
    for k in range(p.shape[1]):
        total = total + rows[:, k] * p[:, k]
    return total
