"""Search the delay in whole samples, and the means, without which a model leaves much more.

Every candidate is fitted by Steiglitz and McBride's iteration; what a simulation of it leaves decides, as a likelihood
ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from firmloop.identify.bench_tests.blackbox import Record, fit_oe, integrating, miss, prefiltered

MOST = 200  # samples of delay that are tried
EARLY = 40  # samples by which an output may lead its input
COARSE = 8  # samples between the delays that are tried first
SHARE = 10  # of the rows at most are delay
CERTAIN = float(scipy.special.chdtri(1, 0.001))  # least gain of a delay in twice the logarithm of the likelihood
_STEPS = (1, 2, 4)  # samples from one delay to those that are compared with it
_EXACT = 1e-9  # of a mean square error: less is rounding
_PAST = (0, 1, 2, 4, 8, 16, 32)  # samples
BACKWARDS = 4.0  # times the mean square error: an integrator leaves up to 2.8 times what it does turned around
WRONG = 1.5  # times the mean square error by which means that are left in spoil a fit


def least_miss(records: Sequence[Record], order: int, late: int) -> float:
    """Return the mean square error of simulating the best model of the iteration."""
    return prefiltered(records, order, late)[1]


@dataclass(frozen=True, slots=True)
class DelaysAlike:
    """From `least` to `most` samples of delay, of which noise lets none be told from the `best`."""

    least: int
    best: int
    most: int


def delays_tried(records: Sequence[Record]) -> int:
    """Return among how many delays the best one is searched, from 0 on."""
    return 1 + min(MOST, min(len(one.output) for one in records) // SHARE)


def best_delays(records: Sequence[Record], order: int) -> DelaysAlike:
    """Return the samples whose models leave no more than the best, as far as noise can tell, from the least on.

    The records are tried as they are, without their means, which helps where they rest away from 0 and harms where
    they begin at rest or the plant integrates, and without a line of the output; what leaves least is what counts.
    """
    rows = sum(len(one.output) for one in records)
    last = delays_tried(records) - 1
    ways = (records, without_means(records), without_lines(records))
    coarse = [{late: least_miss(each, order, late) for late in range(0, last + 1, COARSE)} for each in ways]
    tried, way = min(zip(coarse, ways, strict=True), key=lambda each: min(each[0].values()))
    left = [tried[late] if late in tried else least_miss(way, order, late) for late in range(last + 1)]

    @cache
    def exact(late: int) -> float:
        """Return what the best model leaves: in much noise the iteration stays far from it."""
        return min(left[late], miss(fit_oe(way, order, late), way)) if left[late] > 0.0 else 0.0

    best = _descended(exact, left.index(min(left)), last)
    least = exact(best)
    if least == 0.0:
        return DelaysAlike(best, best, best)

    def alike(late: int) -> bool:
        if not 0 <= late <= last:
            return False
        return any(rows * math.log(each(late) / least) < CERTAIN for each in (left.__getitem__, exact))

    found = most = next(
        late for late in range(last + 1) if rows * math.log(left[late] / least) < CERTAIN or late == best
    )
    while alike(found - 1):
        found -= 1
    while alike(most + 1):
        most += 1
    return DelaysAlike(found, best, most)


def _descended(left: Callable[[int], float], best: int, last: int) -> int:
    """Return the delay from which none nearby, from 0 to `last`, leaves less."""
    steps = [sign * size for size in _STEPS for sign in (-1, 1)]
    while better := [best + step for step in steps if 0 <= best + step <= last and left(best + step) < left(best)]:
        best = min(better, key=left)
    return best


def samples_early(records: Sequence[Record], order: int) -> int:
    """Return by how many samples the output answers before its input acts; 0 where a model without delay does as well.

    It is the least shift of the output that leaves no more than the best, as far as noise can tell.
    """
    rows = sum(len(one.output) for one in records)
    own = min(least_miss(records, order, 0), miss(fit_oe(records, order, 0), records))
    left = [max(each, own * _EXACT) for each in _early_misses(records, order)]
    least = min(left, default=own)
    if own <= WRONG * least or rows * math.log(own / least) < CERTAIN:
        return 0
    return next(late for late, one in enumerate(left, 1) if rows * math.log(one / least) < CERTAIN)


def runs_backwards(records: Sequence[Record], order: int) -> bool:
    """Tell whether a model leaves much less of the rows from the last to the first, as of no plant it does.

    A second order, for one of too low an order leaves much both ways; and no less may be left by an output that leads.
    """
    order = max(order, 2)
    turned = [Record(one.source, one.drive[::-1].copy(), one.output[::-1].copy()) for one in records]
    own, other = (
        min(least_miss(way, order, 0) for way in (each, without_means(each), without_lines(each)))
        for each in (records, turned)
    )
    return other * BACKWARDS < own and other * BACKWARDS < min(_early_misses(records, order), default=own)


def _early_misses(records: Sequence[Record], order: int) -> list[float]:
    """Return what is left of an output that leads its input by one sample, two, and so on."""
    last = min(EARLY, min(len(one.output) for one in records) // SHARE)
    shifted = ([_shifted(one, late) for one in records] for late in range(1, last + 1))
    return [least_miss(each, order, 0) for each in shifted]


def _shifted(record: Record, late: int) -> Record:
    """Return the record with its output `late` samples later."""
    return Record(record.source, record.drive[late:], record.output[: len(record.output) - late])


def without_means(records: Sequence[Record]) -> list[Record]:
    """Take the mean off both signals of every recording, as `remove_offset` does."""
    return [Record(one.source, one.drive - one.drive.mean(), one.output - one.output.mean()) for one in records]


def begun_at(records: Sequence[Record]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return where input and output stand before the input first changes, or before it came up from 0, on an average.

    An input that comes up in the first row acts from there on: its output still stands as without it.
    """
    counts = [int(np.argmax(np.append(one.drive, np.nan) != one.drive[0])) for one in records]
    held = [one.output[:count].mean() for one, count in zip(records, counts, strict=True)]
    return (
        (float(np.mean([one.drive[0] for one in records])), float(np.mean(held))),
        (0.0, float(np.mean([one.output[0] for one in records]))),
    )


def from_rest(records: Sequence[Record], rest: tuple[float, float]) -> list[Record]:
    """Take one level of rest each off the inputs and the outputs of all recordings."""
    return [Record(one.source, one.drive - rest[0], one.output - rest[1]) for one in records]


def spoiled_by_rest(records: Sequence[Record], order: int, late: int) -> tuple[float, float] | None:
    """Return where the recordings begin at rest, if that taken off leaves much less, and least of what may be.

    What integrates rests anywhere: where it begins is no level of its own.
    """
    left = {rest: least_miss(from_rest(records, rest), order, late) for rest in begun_at(records)}
    best = min(left, key=lambda rest: left[rest])
    if WRONG * left[best] >= least_miss(records, order, late):
        return None
    others = (least_miss(each, order, late) for each in (without_means(records), without_lines(records)))
    begun = from_rest(records, best)
    settles = np.all(np.abs(np.linalg.eigvals(integrating(fit_oe(begun, order, late), begun).a)) < 1.0)
    return best if left[best] <= min(others) and settles else None


def without_lines(records: Sequence[Record]) -> list[Record]:
    """Take the input's mean and the output's best straight line off every recording."""
    return [
        Record(one.source, one.drive - one.drive.mean(), np.asarray(scipy.signal.detrend(one.output)))
        for one in records
    ]


def spoiled_by_lines(records: Sequence[Record], order: int, late: int) -> bool:
    """Tell whether the model leaves much less where the output loses its line, and not only its mean."""
    line, mean, own = (
        least_miss(each, order, late) for each in (without_lines(records), without_means(records), records)
    )
    return min(mean, own) > WRONG * line


def spoiled_by_means(records: Sequence[Record], order: int, late: int) -> bool:
    """Tell whether the model leaves much less where the means are taken off."""
    free = without_means(records)
    return least_miss(records, order, late) > WRONG * least_miss(free, order, late)


def rest_of_an_integrator(records: Sequence[Record], order: int, late: int) -> float | None:
    """Return the input at which a plant that integrates stands still; None where that does not explain more than means.

    The output is a line over time, the sum of the input, and lags, which the input's past stands for: the ratio of both
    slopes is it.
    """
    columns, outputs, from_zero = [], [], []
    for one in records:
        past = [np.concatenate([np.full(k, one.drive[0]), one.drive[: len(one.drive) - k]]) for k in _PAST]
        each = np.column_stack([np.arange(len(one.output)), np.cumsum(one.drive) - one.drive, *past])
        columns.append(each - each.mean(axis=0))
        outputs.append(one.output - one.output.mean())
        from_zero.append(Record(one.source, one.drive, one.output - one.output[0]))
    slopes = np.linalg.lstsq(np.concatenate(columns), np.concatenate(outputs))[0]
    if slopes[1] == 0.0 or not np.all(np.isfinite(slopes)):
        return None
    rest = float(-slopes[0] / slopes[1])
    moved = [Record(one.source, one.drive - rest, one.output) for one in from_zero]
    left = least_miss(moved, order, late)
    # An output that drifts has a line, too.
    others = (least_miss(each, order, late) for each in (without_means(records), without_lines(records)))
    return rest if WRONG * left < min(others) else None
