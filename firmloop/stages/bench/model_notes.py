"""Say what is to be known of a model that data alone gave: its delay, its noise, and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from firmloop.identify.bench_tests.blackbox import (
    PULLED,
    Record,
    SampledModel,
    fit_oe,
    least_squares_arx,
    miss,
    residuals,
)
from firmloop.identify.bench_tests.delay_search import DelaysAlike, least_miss, runs_backwards, samples_early
from firmloop.identify.fitting.residual_tests import residual_tests

FOLLOWS = 1e-3  # least probability of residuals as independent of the input as these
WHITE = 0.01  # least probability of residuals as white as these: else drawing them anew is no repetition
LINE = 0.5  # of the variance of what a model leaves: a line that explains more is a drift


def about_noise(structure: str, records: Sequence[Record], model: SampledModel) -> str:
    """Say where noise that does not pass the plant's poles, as a sensor's does not, pulls a one-step model away."""
    order, late = len(model.a), model.late
    if structure == "arx" and miss(least_squares_arx(records, order, late), records) >= PULLED * least_miss(
        records, order, late
    ):
        return (
            "the noise is the sensor's, which pulls gain and poles of an arx model away, so that simulated past "
            "outputs stand in for the measured ones; structure = 'oe' is made for such noise"
        )
    if structure != "n4sid":
        return ""
    own, other = (math.sqrt(miss(each, records)) for each in (model, fit_oe(records, order, late)))
    if own**2 < PULLED * other**2:
        return ""
    return (
        f"simulated from the input alone, n4sid leaves {own:.3g} rms, and output error of the same order {other:.3g}: "
        "gain and poles of n4sid are off by more than noise; take structure = 'oe'"
    )


def about_drift(records: Sequence[Record], drive: str, output: str) -> str:
    """Say that the output drifts, and what takes that off."""
    lines = [_line(one.output) for one in records]
    slopes = [(float(line.coef[1]), one.source) for line, one in zip(lines, records, strict=True)]
    slope, where = max(slopes, key=lambda each: abs(each[0]))
    return (
        f"{where}: {output} {_drifts(slope)}, and a model without that line leaves much less: {_without_line(output)} "
        f'and remove_offset = ["{drive}"]; if the plant is that slow, raise model.order'
    )


def _drifts(slope: float) -> str:
    return f"drifts by {2.0 * slope:.3g} from its first row to its last"


def _without_line(output: str) -> str:
    return (
        "let the plant warm up first, or, if only the zero of the sensor wanders, write "
        f'[recordings.conditioning] detrend = ["{output}"]'
    )


def _line(values: np.ndarray) -> np.polynomial.Polynomial:
    """Return the best straight line over a place from -1, the first row, to 1, the last."""
    return np.polynomial.Polynomial.fit(np.linspace(-1.0, 1.0, len(values)), values, 1, [-1.0, 1.0])


def about_line(records: Sequence[Record], model: SampledModel, output: str) -> list[str]:
    """Say of which recording a straight line over time explains most of what the model leaves."""
    found = []
    for one, left in zip(records, residuals(model, records), strict=True):
        line = _line(left)
        slope = float(line.coef[1])
        rest = left - line(np.linspace(-1.0, 1.0, len(left)))
        if np.var(rest) < (1.0 - LINE) * np.var(left) and 2.0 * abs(slope) < np.ptp(one.output):
            found.append(f"what the model leaves of {one.source} {_drifts(slope)}: {_without_line(output)}")
    return found


def about_lead(records: Sequence[Record], order: int, drive: str, output: str) -> str:
    """Say by how many rows the output answers before the input acts, if it does."""
    rows = samples_early(records, order)
    if not rows:
        return ""
    count = "1 row" if rows == 1 else f"{rows} rows"
    return (
        f"{output} answers {count} before {drive} changes, which no plant does: a row's input acts from that row on, "
        f"and its output is read before; shift the column {output} down by {count}, or {drive} up, if they were logged "
        "by two clocks, filtered to and fro, or read after the input had acted; exchange both names if "
        f"{output} is what drives"
    )


def about_order(records: Sequence[Record], order: int, drive: str, output: str) -> str:
    """Say that the rows stand in the wrong order, if a model follows them from the last to the first alone."""
    if not runs_backwards(records, order):
        return ""
    return (
        f"{', '.join(one.source for one in records)}: {output} answers {drive} from the last row to the first, and not "
        "from the first to the last: the rows stand in the wrong order; turn them around in the file, and number the "
        "times anew"
    )


def about_rest(judged: Mapping[str, object], structure: str) -> str:
    """Say where what a model leaves of a recording follows the input still."""
    independence = judged["independence"]
    if not isinstance(independence, float) or independence >= FOLLOWS:
        return ""
    other = "" if structure == "oe" else " or take structure = 'oe'"
    return (
        f"what the model leaves of {judged['recording']} still follows the input (probability {independence:.1g} by "
        f"chance), so that its gain and poles are off: raise model.order{other}, or fit a plant with physics"
    )


def _samples(found: DelaysAlike, where: str = "") -> str:
    """Tell the least delay, where it was found, and up to which one others do as well."""
    alike = f" ({found.least} to {found.most} fit alike)" if found.most > found.least else ""
    return f"{found.best} sample{'' if found.best == 1 else 's'} of delay{where}{alike}"


def found_delay(found: DelaysAlike) -> str:
    """Say where a delay comes from that nobody gave."""
    return f"{_samples(found, ' found by search')}; model.delay_samples sets another" if found.most else ""


def given_delay(records: Sequence[Record], order: int, told: int, found: DelaysAlike) -> str:
    """Say that the recordings ask for another delay than the given one, where that does worse by any measure.

    What it leaves may be white, though another leaves a little less.
    """
    if found.least <= told <= found.most:
        return ""
    own, other = (_whiteness(fit_oe(records, order, late), records) for late in (told, found.best))
    if own >= max(WHITE, other):
        return ""
    return f"model.delay_samples is {told}; the recordings ask for {_samples(found)}"


def _whiteness(model: SampledModel, records: Sequence[Record]) -> float:
    """Return the least probability with which what a simulation leaves of a recording would be white."""
    tests = [residual_tests(left, one.drive) for one, left in zip(records, residuals(model, records), strict=True)]
    return min(one.whiteness for one in tests)
