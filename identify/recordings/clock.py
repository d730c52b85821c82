"""Give back to time stamps the digits that a file has rounded away, where their rows were even."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DIGITS = range(4, 13)  # significant ones a program may print


def evened(time: Array) -> Array:
    """Return an even grid where rounding alone makes `time` (n,) depart from it, else `time` as it is.

    147.4527, 147.4544, 147.456 are three rows 1.6384 ms apart that were printed with seven digits: taken at their word
    they would jitter by 4 % of a row. The digits are the fewest that print every stamp.
    """
    grid = time[0] + np.arange(len(time)) * ((time[-1] - time[0]) / (len(time) - 1))
    for digits in _DIGITS:
        unit = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(time), 1e-300))) + 1 - digits)
        if np.all(np.abs(np.round(time / unit) * unit - time) <= 1e-12 * np.abs(time)):
            # Both ends are rounded too, so that the grid may be off by as much as a stamp.
            near = np.abs(time - grid) <= 0.5 * unit * (1.0 + 1e-6) + 0.5 * max(unit[0], unit[-1])
            return grid if bool(np.all(near)) else time
    return time
