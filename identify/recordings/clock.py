"""Give back to time stamps the digits that a file has rounded away, where their rows were even."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DIGITS = range(4, 13)  # significant ones a program may print
_FEW = 1000  # stamps
_MISSING = 1.5  # usual steps, from which a row is missing


def breaks(time: Array) -> NDArray[np.intp]:
    """Return the rows before which a row is missing."""
    steps = np.diff(time)
    return np.flatnonzero(steps > _MISSING * np.median(steps)) + 1


def evened(time: Array) -> Array:
    """Return an even grid where rounding alone makes `time` (n,) depart from it, else `time` as it is.

    147.4527, 147.4544, 147.456 are three rows 1.6384 ms apart that were printed with seven digits: taken at their word
    they would jitter by 4 % of a row. The digits are the fewest that print every stamp.
    """
    grid = time[0] + np.arange(len(time)) * ((time[-1] - time[0]) / (len(time) - 1))
    for digits in _DIGITS:
        if _prints(time[-_FEW:], digits) and _prints(time, digits):  # a few stamps tell most numbers of digits at once
            # Both ends are rounded too, so that the grid may be off by as much as a stamp.
            unit = _unit(time, digits)
            near = np.abs(time - grid) <= 0.5 * unit * (1.0 + 1e-6) + 0.5 * max(unit[0], unit[-1])
            return grid if bool(np.all(near)) else time
    return time


def _unit(time: Array, digits: int) -> Array:
    """Return the size of the last of so many significant digits of every stamp."""
    return np.asarray(10.0 ** (np.floor(np.log10(np.maximum(np.abs(time), 1e-300))) + 1 - digits))


def _prints(time: Array, digits: int) -> bool:
    """Tell whether so many significant digits print every stamp."""
    unit = _unit(time, digits)
    return bool(np.all(np.abs(np.round(time / unit) * unit - time) <= 1e-12 * np.abs(time)))
