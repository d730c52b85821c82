"""Run the sweeps of a quadratic program bit for bit: the twins of fl_sweeps.h and fl_sweeps_i32.h.

`q` holds the members and the sizes of the structure there, as arrays of the element type in which the program runs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.outcome import CAPPED, SOLVED
from firmloop.design.quadratic.splitting import STEP
from firmloop.quantize.program import Table

Raw = NDArray[Any]


def ready(table: Table, kind: np.dtype[Any]) -> dict[str, Any]:
    """Make a table ready for `run`: its members as arrays of `kind`."""
    sizes = dict(table.sizes)
    found: dict[str, Any] = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    rows, width, size = sizes["FL_QP_ROWS"], sizes["FL_QP_WIDTH"], sizes["FL_QP_PARAMETERS"]
    if kind.kind == "f":
        for key in ("slope", "push", "mix"):
            found[key] = found[key].reshape(-1, width)[:, :rows]
    else:
        found["slope"], found["push"] = found["slope"].reshape(rows, size), found["push"].reshape(rows, size)
        found["mix"] = found["mix"].reshape(width, rows)[:rows]
    return found | sizes


def run(q: dict[str, Any], *parameters: Any) -> Raw:
    """Return the moves, then the status, one row each, a column a lane."""
    p = np.stack(np.broadcast_arrays(*(np.atleast_1d(x) for x in parameters)), axis=-1)
    with np.errstate(all="ignore"):
        moves, y, c = _floating(q, p) if p.dtype.kind == "f" else _integer(q, p)
        missed = y - c
        near = np.all((missed <= q["tolerance"]) & (missed >= -q["tolerance"]), axis=1)
    return np.vstack([moves.T, np.where(near, SOLVED, CAPPED).astype(p.dtype)])


def _floating(q: dict[str, Any], p: Raw) -> tuple[Raw, Raw, Raw]:
    s, push = _added(q["slope"], p), _added(q["push"], p)
    for k in range(q["FL_SWEEPS"]):
        s = _limited(s, -q["reach"], q["reach"])
        c = _limited(s, q["low"], q["high"])
        mirrored = (c + c) - s
        y = push
        for j in range(q["FL_QP_ROWS"]):
            y = y + q["mix"][j] * mirrored[:, j : j + 1]
        if k < q["FL_SWEEPS"] - 1:
            s = s + p.dtype.type(STEP) * (y - c)
    drives = q["FL_QP_MOVES"]
    return _limited(y, q["low"], q["high"])[:, :drives] * q["scale"], y, c


def _added(columns: Raw, p: Raw) -> Raw:
    total: Raw = columns[0] * p[:, :1]
    for k in range(1, len(columns)):
        total = total + columns[k] * p[:, k : k + 1]
    return total


def _limited(x: Raw, low: Raw, high: Raw) -> Raw:
    """Limit `x`; what is no number stays none."""
    limited: Raw = np.where(x < low, low, np.where(x > high, high, x))
    return limited


def _integer(q: dict[str, Any], p: Raw) -> tuple[Raw, Raw, Raw]:
    def half(shift: int) -> int:
        return 1 << (shift - 1)

    s = (p @ q["slope"].T + half(q["FL_SHIFT_SLOPE"])) >> q["FL_SHIFT_SLOPE"]
    push = (p @ q["push"].T + half(q["FL_SHIFT_PUSH"])) >> q["FL_SHIFT_PUSH"]
    s = np.clip(s, -q["reach"], q["reach"])
    for k in range(q["FL_SWEEPS"]):
        c = np.clip(s, q["low"], q["high"])
        y = push + ((((c + c) - s) @ q["mix"] + half(q["FL_SHIFT_MIX"])) >> q["FL_SHIFT_MIX"])
        if k < q["FL_SWEEPS"] - 1:
            s = np.clip(s + ((7 * (y - c) + 2) >> 2), -q["reach"], q["reach"])
    drives, shift = q["FL_QP_MOVES"], q["FL_SHIFT_SCALE"]
    ends = np.clip(y, q["low"], q["high"])[:, :drives]
    return np.clip((ends * q["scale"] + half(shift)) >> shift, q["least"], q["most"]), y, c
