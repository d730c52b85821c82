"""Search the delay in whole samples, and the means, without which a model leaves much more.

Every candidate is fitted by Steiglitz and McBride's iteration; what a simulation of it leaves decides, as a likelihood
ratio.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import scipy.stats

from firmloop.identify.bench_tests.blackbox import Record, fit_oe, miss, prefiltered

MOST = 200  # samples of delay that are tried
COARSE = 8  # samples between the delays that are tried first
SHARE = 10  # of the rows at most are delay
CERTAIN = float(scipy.stats.chi2.ppf(0.999, 1))  # least gain of a delay in twice the logarithm of the likelihood
WRONG = 1.5  # times the mean square error by which means that are left in spoil a fit


def least_miss(records: Sequence[Record], order: int, late: int) -> float:
    """Return the mean square error of simulating the best model of the iteration."""
    return miss(prefiltered(records, order, late), records)


def best_delay(records: Sequence[Record], order: int) -> int:
    """Return the least number of samples whose model leaves no more than the best, as far as noise can tell.

    The records are tried as they are and without their means, which helps where they rest away from 0 and harms where
    they begin at rest or the plant integrates; the way that leaves less is the one that counts.
    """
    rows = sum(len(one.output) for one in records)
    last = min(MOST, min(len(one.output) for one in records) // SHARE)
    ways = (records, without_means(records))
    way = min(ways, key=lambda each: min(least_miss(each, order, late) for late in range(0, last + 1, COARSE)))
    left = [least_miss(way, order, late) for late in range(last + 1)]
    least = min(left)
    if least == 0.0:
        return left.index(0.0)
    found = next(late for late, one in enumerate(left) if rows * math.log(one / least) < CERTAIN)
    while found > 0 and rows * math.log(miss(fit_oe(way, order, found - 1), way) / least) < CERTAIN:
        found -= 1  # the iteration does not always reach the best model
    return found


def without_means(records: Sequence[Record]) -> list[Record]:
    """Take the mean off both signals of every recording, as `remove_offset` does."""
    return [Record(one.source, one.drive - one.drive.mean(), one.output - one.output.mean()) for one in records]


def spoiled_by_means(records: Sequence[Record], order: int, late: int) -> bool:
    """Tell whether the model leaves much less where the means are taken off."""
    free = without_means(records)
    return least_miss(records, order, late) > WRONG * least_miss(free, order, late)
