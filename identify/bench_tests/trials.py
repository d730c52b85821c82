"""Put repeated trials together: mean and 95 % interval of each figure, by Student's t."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from firmloop.identify.error import IdentifyError

FEWEST = 3


@dataclass(frozen=True, slots=True)
class Repeated:
    """One figure over `trials` trials; `half` is half the width of its 95 % interval, `deviation` that of one trial."""

    mean: float
    half: float
    deviation: float
    trials: int


def repeated(values: Sequence[float]) -> Repeated:
    """Average trials; the interval is mean -+ t_0.975(n - 1) s / sqrt(n) (Gosset, Biometrika 6 (1908) 1-25).

    A value that is not finite in one trial is not finite in the mean. Raises IdentifyError for fewer than 3 trials.
    """
    count = len(values)
    if count < FEWEST:
        raise IdentifyError(f"an interval needs at least {FEWEST} trials, but there are {count}; record more of them")
    if not np.all(np.isfinite(values)):
        return Repeated(float(np.mean(values)), math.nan, math.nan, count)
    deviation = float(np.std(values, ddof=1))
    half = float(scipy.special.stdtrit(count - 1, 0.975)) * deviation / math.sqrt(count)
    return Repeated(float(np.mean(values)), half, deviation, count)
