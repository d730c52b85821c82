"""Project columns: an orthonormal basis of slopes, and what no combination of it can imitate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.least_squares import triangle

Array = NDArray[np.float64]


def with_starts(slopes: Array, count: int, index: int, lot: int) -> Array:
    """Return the slopes (n, r, count + s) of recording `index` with a place for the initial state of each of `lot`."""
    states = slopes.shape[2] - count
    wide = np.zeros((*slopes.shape[:2], count + states * lot))
    wide[..., :count] = slopes[..., :count]
    wide[..., count + states * index : count + states * (index + 1)] = slopes[..., count:]
    return wide


def outside(basis: Array, tall: Array) -> Array:
    """Return what no combination of an orthonormal basis (rows, k) can imitate of (rows,) or (rows, c)."""
    return np.asarray(tall - basis @ (basis.T @ tall))


def orthogonal(tall: Array) -> Array:
    """Return an orthonormal basis (rows, k) of the columns; nearly parallel ones are dropped."""
    return np.asarray(tall @ turn(tall))


def turn(tall: Array) -> Array:
    """Return the matrix (c, k) that makes an orthonormal basis of the columns of (rows, c)."""
    norms = np.linalg.norm(tall, axis=0)
    live = norms > 0.0
    _, widths, turned = np.linalg.svd(triangle(tall[:, live] / norms[live]))
    kept = widths > 1e-7
    whole = np.zeros((len(norms), int(kept.sum())))
    whole[live] = turned[kept].T / widths[kept] / norms[live][:, None]
    return whole
