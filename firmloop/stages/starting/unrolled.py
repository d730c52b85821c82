"""Unroll counts of an encoder that wrap where their word ends, such as at 65536, before anything is guessed of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.columns import going_on
from firmloop.identify.recordings.guess import Guessed
from firmloop.identify.recordings.table import RawTable
from firmloop.identify.recordings.wrapping import TURN, wrapping

Array = NDArray[np.float64]

_BITS = (8, 32)  # of a counter, fewest and most


def unrolled(table: RawTable, moving: Sequence[Guessed]) -> tuple[RawTable, Mapping[str, float]]:
    """Return the table with such counts of the `moving` columns going on, and where each of them wraps."""
    held = dict(zip(table.names, table.columns, strict=True))
    free = [each.foreign for each in moving if not each.unit and not each.quantity]
    wraps = {name: size for name in free if (size := _word(held[name]))}
    columns = tuple(
        going_on(column, wraps[name], is_time=False) if name in wraps else column
        for name, column in zip(table.names, table.columns, strict=True)
    )
    return replace(table, columns=columns), wraps


def _word(values: Array) -> float:
    """Return where whole numbers wrap that do so at the end of a word; 0 where they do not."""
    found = wrapping([values]) if np.all(values == np.round(values)) else None
    if found is None:
        return 0.0
    bits = round(math.log2(found[0]))
    return 2.0**bits if _BITS[0] <= bits <= _BITS[1] and abs(found[0] / 2.0**bits - 1.0) < TURN else 0.0
