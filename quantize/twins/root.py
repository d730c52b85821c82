"""The square root from + - * / alone, the twin of those in `fl_root.h`: the same bits on every machine.

Half the exponent of x is a root right to 4 %; Heron's step r = (r + x/r)/2 turns a relative error e into about e^2/2
(Heron, Metrica, book 1, chapter 8), so that three of them end at the rounding of float32 and four at that of float64.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Interval = tuple[float, float]

ROOT_ERROR = 4.0  # units of rounding, relative to the root
SMALLEST = {"f4": 1.1754944e-38, "f8": 2.2250738585072014e-308}  # what is below counts as 0
_START = {"f4": 0x1FBB4F2E, "f8": 0x1FF769E5C0000000}  # half the bias of the exponent, less what evens the error out
_STEPS = {"f4": 3, "f8": 4}
_WIDER = 1e-6


def root(x: Any) -> NDArray[Any]:
    """Return the square root; 0 for what is below any normal number, or no number."""
    x = np.asarray(x)
    name, kind = x.dtype.str[1:], x.dtype.type
    word = np.dtype(f"u{x.dtype.itemsize}")
    with np.errstate(all="ignore"):
        found = ((x.view(word) >> word.type(1)) + word.type(_START[name])).view(x.dtype)
        for _ in range(_STEPS[name]):
            found = kind(0.5) * (found + x / found)
        value: NDArray[Any] = np.where(x >= kind(SMALLEST[name]), found, kind(0))
        return value


def root_bound(a: Interval) -> Interval:
    """Bound the root of a value that is not negative where it matters."""
    low, high = (math.sqrt(max(end, 0.0)) for end in a)
    return low * (1.0 - _WIDER), high * (1.0 + _WIDER)
