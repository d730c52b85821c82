"""Filter rows by a ratio of polynomials, by LAPACK alone: scipy.signal takes half a second to load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

Array = NDArray[np.float64]


def filtered(above: Array, below: Array, values: Array) -> Array:
    """Return sum above[j] values[k-j] - sum below[j] result[k-j] for rows k of `values` (n, ...), from rest.

    `below[0]` is 1. The recursion is a triangular system with `below` along its diagonals.
    """
    result = above[0] * values
    for lag in range(1, min(len(above), len(values))):
        result[lag:] += above[lag] * values[:-lag]
    if len(below) == 1 or len(values) == 0:
        return np.asarray(result)
    diagonals = np.empty((len(below), len(values)), order="F")
    diagonals[:] = below[:, None]
    solved, _ = dtbtrs(diagonals, result.reshape(len(values), -1), uplo="L", diag="U")
    return np.asarray(solved.reshape(values.shape))
