"""The cheapest way through rows that each have the same places (Viterbi 1967)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cheapest(own: Array, step: Callable[[int], Array]) -> NDArray[np.int64]:
    """Return the place (n,) in every row.

    `own` (n, k) is what each place costs in a row, `step(row)` (k, k) what it costs to come there from the row before:
    from the first axis to the second.
    """
    cost, came = own[0], np.zeros(own.shape, dtype=np.int64)
    for row in range(1, len(own)):
        ways = cost[:, None] + step(row)
        came[row] = np.argmin(ways, axis=0)
        cost = ways[came[row], np.arange(own.shape[1])] + own[row]
    places = np.zeros(len(own), dtype=np.int64)
    places[-1] = np.argmin(cost)
    for row in range(len(own) - 1, 0, -1):
        places[row - 1] = came[row, places[row]]
    return places
