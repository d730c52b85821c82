"""Draw the parameters of a law's quadratic program from the whole region that the law declares.

The law's inputs and states are drawn over their ranges: at the corners, evenly, and toward the middle.
"""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

from firmloop.design.law import Law

Array = npt.NDArray[np.float64]

CORNERS = 9  # of so many inputs and states all corners are drawn


def drawn_parameters(law: Law, count: int, seed: int) -> Array:
    """Return parameters (lanes, p): `count` evenly, `count` toward the middle, and the corners."""
    assert law.solve is not None
    signals = (*law.state, *law.inputs)
    low, high = (np.array([getattr(signal, end) for signal in signals]) for end in ("low", "high"))
    points = low + (high - low) * _shares(len(signals), count, seed)
    split = len(law.state)
    return np.array(law.solve.function.map(len(points))(points[:, :split].T, points[:, split:].T)).T


def box_of(law: Law) -> tuple[Array, Array]:
    """Return the least box (p,), (p,) that holds the parameters while inputs and states keep their ranges."""
    assert law.solve is not None
    signals = (*law.state, *law.inputs)
    low, high = (np.array([getattr(signal, end) for signal in signals]) for end in ("low", "high"))
    split, middle = len(law.state), (low + high) / 2
    function = law.solve.function
    rows = np.array(function.map(1 + len(middle))(*_split(np.vstack([middle, middle + np.diag(high - middle)]), split)))
    at = rows[:, 0]
    reach = np.abs(rows[:, 1:] - at[:, None]).sum(axis=1)  # the function is affine
    return at - reach, at + reach


def _split(points: Array, at: int) -> tuple[Array, Array]:
    return points[:, :at].T, points[:, at:].T


def _shares(width: int, count: int, seed: int) -> Array:
    """Return points of the unit cube (points, width)."""
    random = np.random.default_rng(seed)
    even = random.uniform(size=(count, width))
    middle = 0.5 + (random.uniform(size=(count, width)) - 0.5) * random.uniform(size=(count, 1))
    corners = (
        np.array(list(itertools.product((0.0, 1.0), repeat=width)))
        if width <= CORNERS
        else random.integers(0, 2, size=(2**CORNERS, width)).astype(np.float64)
    )
    return np.concatenate([even, middle, corners])
