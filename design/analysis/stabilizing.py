"""Find the gain nearest to the given one at which an unstable loop becomes stable, by Nyquist's criterion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Response = npt.NDArray[np.complex128]

ASIDE = 1e-6  # of a frequency, to see which way the loop crosses the real axis
TRIALS = 4  # of gains that may make a loop stable: each takes all of its poles


def leaving(response: Callable[[Array], Response], turn: float, nyquist: float) -> int:
    """Return how many poles leave the unit circle at `turn` rad/s as the gain rises, by Nyquist's criterion.

    Where L goes up through the negative real axis, the point -1/gain changes from its left side to its right one.
    """
    single = turn in (0.0, nyquist)
    aside = turn * (1 - ASIDE) if turn == nyquist else turn * (1 + ASIDE) or ASIDE * nyquist
    up = bool(response(np.array([aside]))[0].imag > 0) != (turn == nyquist)
    return (1 if up else -1) * (1 if single else 2)


def stabilizing(gains: Sequence[float], left: Sequence[int], holds: Callable[[float], bool]) -> float:
    """Return the factor nearest to 1 behind which the loop is stable, NaN for none.

    Poles cross the circle at `gains` alone, so that one trial in between tells of all of an interval. It is made where
    the fewest poles are outside; `left` are those that leave at each, as the gain rises.
    """
    found = []  # (poles outside beside those at 1, the factor, the next one)
    for side in (1, -1):
        order = sorted(range(len(gains)), key=lambda k: side * gains[k])
        beyond = [k for k in order if side * (gains[k] - 1) > 0]
        outside = 0
        for place, k in enumerate(beyond):
            outside += side * left[k]
            end = gains[beyond[place + 1]] if place + 1 < len(beyond) else gains[k] ** 2
            found.append((outside, abs(math.log(gains[k])), math.sqrt(gains[k] * end), gains[k]))
    for _, _, between, factor in sorted(found)[:TRIALS]:
        if holds(between):
            return factor
    return math.nan
