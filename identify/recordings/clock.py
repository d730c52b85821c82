"""Give back to time stamps the digits that a file has rounded away, where their rows were even."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DIGITS = range(4, 13)  # significant ones a program may print
_PLACES = range(10)  # behind the point
_EVEN = 1e-6  # of a step: stamps so near to even are taken as they are
_FEW = 1000  # stamps
_MISSING = 1.5  # usual steps, from which a row is missing


def breaks(time: Array) -> NDArray[np.intp]:
    """Return the rows before which a row is missing."""
    steps = np.diff(time)
    return np.flatnonzero(steps > _MISSING * np.median(steps)) + 1


def evened(time: Array) -> Array:
    """Return an even grid where rounding alone makes `time` (n,) depart from it, else `time` as it is.

    147.4527, 147.4544, 147.456 are three rows 1.6384 ms apart that were printed with seven digits: taken at their word
    they would jitter by 4 % of a row. The digits are the fewest that print every stamp, those behind the point or all.
    """
    if len(time) < 2:
        return time
    step = float(time[-1] - time[0]) / (len(time) - 1)
    grid = time[0] + np.arange(len(time)) * step
    away = float(np.max(np.abs(time - grid)))
    if away <= _EVEN * step:
        return time
    for places in _PLACES:
        unit = 10.0**-places
        if _multiples(time[-_FEW:], unit) and _multiples(time, unit):
            # Both ends are rounded, too; where a row is missing, the grid is off by half a row.
            return grid if away <= unit * (1.0 + 1e-6) and 2.0 * unit < step else _evened_by_digits(time, grid)
    return _evened_by_digits(time, grid)


def _multiples(time: Array, unit: float | Array) -> bool:
    return bool(np.all(np.abs(np.round(time / unit) * unit - time) <= 1e-12 * np.abs(time)))


def _evened_by_digits(time: Array, grid: Array) -> Array:
    for digits in _DIGITS:
        unit = _unit(time, digits)
        if _multiples(time[-_FEW:], unit[-_FEW:]) and _multiples(time, unit):  # few stamps tell most numbers of digits
            # Both ends are rounded too, so that the grid may be off by as much as a stamp.
            near = np.abs(time - grid) <= 0.5 * unit * (1.0 + 1e-6) + 0.5 * max(unit[0], unit[-1])
            return grid if bool(np.all(near)) else time
    return time


def _unit(time: Array, digits: int) -> Array:
    """Return the size of the last of so many significant digits of every stamp."""
    return np.asarray(10.0 ** (np.floor(np.log10(np.maximum(np.abs(time), 1e-300))) + 1 - digits))
