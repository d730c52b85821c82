"""Search the delay in whole samples, and the means, without which a model leaves much more.

Every candidate is fitted by Steiglitz and McBride's iteration (IEEE Trans. AC 10 (1965) 461-464): least squares on
signals filtered by the last denominator, which comes near to the output-error fit in a few linear steps. What a
simulation of it leaves decides, as a likelihood ratio.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.signal
import scipy.stats

from firmloop.identify.bench_tests.blackbox import Record, fit_arx, miss, steadied

ROUNDS = 6
MOST = 200  # samples of delay that are tried
SHARE = 10  # of the rows at most are delay
CERTAIN = float(scipy.stats.chi2.ppf(0.999, 1))  # least gain of a delay in twice the logarithm of the likelihood
WRONG = 1.5  # times the mean square error by which means that are left in spoil a fit


def least_miss(records: Sequence[Record], order: int, late: int) -> float:
    """Return the mean square error of simulating the best model of the iteration."""
    model = steadied(fit_arx(records, order, late))
    best = miss(model, records)
    for _ in range(ROUNDS):
        below = np.concatenate([[1.0], -model.a[:, 0]])
        passed = [
            Record(one.source, *(scipy.signal.lfilter([1.0], below, part) for part in (one.drive, one.output)))
            for one in records
        ]
        if not all(np.all(np.isfinite(part)) for one in passed for part in (one.drive, one.output)):
            break
        model = steadied(fit_arx(passed, order, late))
        best = min(best, miss(model, records))
    return best


def best_delay(records: Sequence[Record], order: int) -> int:
    """Return the least number of samples whose model leaves no more than the best, as far as noise can tell."""
    rows = sum(len(one.output) for one in records)
    shortest = min(len(one.output) for one in records)
    left = [least_miss(records, order, late) for late in range(min(MOST, shortest // SHARE) + 1)]
    least = min(left)
    if least == 0.0:
        return left.index(0.0)
    return next(late for late, one in enumerate(left) if rows * math.log(one / least) < CERTAIN)


def without_means(records: Sequence[Record]) -> list[Record]:
    """Take the mean off both signals of every recording, as `remove_offset` does."""
    return [Record(one.source, one.drive - one.drive.mean(), one.output - one.output.mean()) for one in records]


def spoiled_by_means(records: Sequence[Record], order: int, late: int) -> bool:
    """Tell whether the model leaves much less where the means are taken off."""
    free = without_means(records)
    return least_miss(records, order, late) > WRONG * least_miss(free, order, late)
