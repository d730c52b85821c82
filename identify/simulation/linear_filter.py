"""Filter rows, by a ratio of polynomials or by a recursion of states, or integrate them.

scipy.signal and scipy.integrate, which do so too, take half a second to load, in each run of a command.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

Array = NDArray[np.float64]


def filtered(above: Array, below: Array, values: Array) -> Array:
    """Return sum above[j] values[k-j] - sum below[j] result[k-j] for rows k of `values` (n, ...), from rest.

    `below[0]` is 1. The recursion is a triangular system with `below` along its diagonals.
    """
    values = np.ascontiguousarray(values, dtype=np.float64)  # one column of many is read far slower
    result, part = above[0] * values, np.empty_like(values)
    for lag in range(1, min(len(above), len(values))):
        result[lag:] += np.multiply(above[lag], values[:-lag], out=part[lag:])
    if len(below) == 1 or len(values) == 0:
        return np.asarray(result)
    diagonals = np.empty((len(below), len(values)), order="F")
    diagonals[:] = below[:, None]
    solved, _ = dtbtrs(diagonals, result.reshape(len(values), -1), uplo="L", diag="U")
    return np.asarray(solved.reshape(values.shape))


def recurred(step: Array, pushes: Array, start: Array) -> Array:
    """Return x (n, ..., s) of x[0] = start and x[k+1] = step x[k] + pushes[k], `pushes` (n - 1, ..., s).

    By doubling (Hillis and Steele 1986): after each of log2(n) passes a row holds what twice as many before it did.
    """
    rows = np.concatenate([start[None], pushes])
    power, reach = step.T, 1
    while reach < len(rows):
        rows[reach:] += rows[:-reach] @ power
        power, reach = power @ power, 2 * reach
    return rows


def integrated(values: Array, time: Array) -> Array:
    """Return the integral (n,) of values (n,) over time (n,) up to each row, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
