"""Halve the way between two inputs of each lane to where a value passes its edge.

Compiled code does the same (`verify/lanes/halving.h`), where there is some; a test compares the two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.reference import Raw

Array = NDArray[np.float64]
Lanes = NDArray[np.int64]


def halved(
    begin: Array,
    there: Array,
    alike: NDArray[np.bool_],
    read: Callable[[Array], Raw],
    same_side: Callable[[Array, Lanes], NDArray[np.bool_]],
    halvings: int,
) -> tuple[Array, Array]:
    """Return how far on the way of each lane (lanes, m) the last two places are between which its side changes.

    Both ends are known: `begin`, and `there`, which is `alike` where it is on the same side. Where the program reads
    what it reads at one of the last two places, it is not asked again.
    """
    near, far, way = np.zeros(len(begin)), np.ones(len(begin)), there - begin
    at_near, at_far = read(begin), read(there)
    for _ in range(halvings):
        middle = (near + far) / 2
        inputs = begin + middle[:, None] * way
        bits = read(inputs)
        as_near, as_far = np.all(bits == at_near, axis=0), np.all(bits == at_far, axis=0)
        same = as_near | (as_far & alike)
        asked = np.flatnonzero(~(as_near | as_far))
        if len(asked):
            same[asked] = same_side(inputs, asked)
        at_near, at_far, alike = np.where(same, bits, at_near), np.where(same, at_far, bits), alike & same
        near, far = np.where(same, middle, near), np.where(same, far, middle)
    return near, far
