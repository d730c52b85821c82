"""Readings that wrap around like an overflowing counter, told by their leaps from one end of the range to the other."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.clock import breaks
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

JUMP = 0.5  # of the range: a change from row to row that only a wrap makes
UNLIKE = 0.05  # of the range, by which wraps differ
_EDGE = 0.25  # of the range: a wrap begins and ends this near to its ends
_BACK = 0.08  # of the range: rows beside a wrap go against it, but for noise
_CALM = 0.2  # of the range: a reading that usually moves more from row to row cannot be unrolled
TURN = 0.02  # of a turn, by which a range may be off it
_FEWEST = 2  # jumps in all recordings


def wrap_of(recordings: Sequence[Recording], name: str) -> float | None:
    """Return by how much a reading falls where it wraps; of recordings without it, or that do not wrap, None."""
    seen = [each for each in recordings if name in each.columns]
    parts = [part for each in seen for part in np.split(each.columns[name], breaks(each.time))]
    wrap = wrapping(parts) if parts else None
    return wrap[0] if wrap is not None else None


def wraps_at_a_turn(recordings: Sequence[Recording], name: str) -> bool:
    """Tell whether an angle, rad, wraps wherever it has made a turn."""
    size = wrap_of(recordings, name)
    return size is not None and abs(size / math.tau - 1.0) < TURN


def wrapping(columns: Sequence[Array]) -> tuple[float, float, float] | None:
    """Return the range of readings that wrap, the lowest of them, and the deviation of the range; None where none does.

    `columns` (n,) are readings row by row, without a gap.
    """
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    reach = high - low
    sizes = []
    for column in columns:
        steps = np.diff(column)
        if float(np.median(np.abs(steps))) > _CALM * reach:
            return None
        for row in np.flatnonzero(np.abs(steps) > JUMP * reach):
            begin, end, side = column[row], column[row + 1], float(np.sign(steps[row]))
            if max(begin, end) < high - _EDGE * reach or min(begin, end) > low + _EDGE * reach:
                return None
            around = [steps[k] for k in (row - 1, row + 1) if 0 <= k < len(steps) and abs(steps[k]) <= JUMP * reach]
            if any(side * step > _BACK * reach for step in around):
                return None  # a wrap goes against the motion around it
            sizes.append(abs(float(steps[row])) - side * float(np.mean(around)) if around else reach)
    usual = np.array(sizes)
    if len(usual) < _FEWEST or float(np.std(usual)) > UNLIKE * reach:
        return None
    return float(np.mean(usual)), low, float(np.std(usual, ddof=1)) / np.sqrt(len(usual))
