"""Hold what one search of a quadratic program reads and keeps: the twins of fl_qp_t and fl_search_t, and their use."""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Raw = NDArray[Any]

LENGTH, WORK, FRESH, HARD = range(4)  # places of `QpSearch.counts`

WITHIN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # only compiled code calls it

compiled = numba.njit(error_model="numpy", **WITHIN)


class QpProblem(NamedTuple):
    """What `fl_qp_t` and the sizes beside it hold, in one element type; `moves` is 0 where answers are not checked."""

    slope: Raw  # (p, m)
    low: Raw
    high: Raw
    gram: Raw
    tolerance: Any
    share: Any
    trusted: Any
    kept: Any
    noise: Any
    least: Any
    far: Any
    none: Any  # 0
    one: Any
    room: int
    budget: int
    moves: int
    many: bool  # a factor of the active rows is kept, no tableau
    shift: Raw  # (c, p)
    onward: Raw  # (c, moves)
    softness: Raw


class QpSearch(NamedTuple):
    """What `fl_search_t` holds; `counts` are the length of the active set, the work, and what is `fresh` and `hard`.

    `eta` belongs to a tableau. To a factor belong `lower`, row by row, `multiplier`, `rate`, `along`, `share`
    (room,), the values at the `start`, and `own`: y and pivot of the entering row.
    """

    value: Raw
    inverse: Raw
    toward: Raw
    active: NDArray[Any]
    side: NDArray[Any]
    counts: NDArray[Any]
    tolerance: Raw  # (1,)
    spare: Raw  # (m,)
    eta: Raw  # (room + 1, m), (0, 0) where a factor is kept
    lower: Raw
    multiplier: Raw
    start: Raw  # (m,)
    rate: Raw
    along: Raw
    share: Raw
    own: Raw  # (2,)


def memory_of(count: int, room: int, many: bool, kind: np.dtype[Any]) -> QpSearch:
    """Return the memory of one search of `count` rows."""
    kept = room if many else 0
    return QpSearch(
        *(np.zeros(count, kind), np.zeros(room, kind), np.zeros(room, kind), np.zeros(room, np.int64)),
        *(np.zeros(count, np.int64), np.zeros(4, np.int64), np.zeros(1, kind), np.zeros(count, kind)),
        np.zeros((0 if many else room + 1, count), kind),
        *(np.zeros(size, kind) for size in ((kept + 1) * kept // 2, kept, count, kept, kept, kept, 2)),
    )


@compiled
def is_hard(q: QpProblem, row: int) -> bool:
    """Tell whether a row is not soft."""
    return row < q.moves or not (q.softness[row - q.moves] > 0)


@compiled
def most_violated(q: QpProblem, s: QpSearch, most: Any) -> int:
    """Return the row outside the active set that is violated by most, -1 where none is by more than `most`."""
    row = -1
    for i in range(len(q.low)):
        if s.side[i] == 0:
            over, under = s.value[i] - q.high[i], q.low[i] - s.value[i]
            excess = over if over > under else under
            if excess > most:
                most = excess
                row = i
    return row
