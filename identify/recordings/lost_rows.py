"""Tell where rows are missing: by the clock, or by a column that counts while the clock goes on as if nothing were."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.columns import rename_line

Array = NDArray[np.float64]

_EVEN = 0.25  # of a row's time: what the clock of even rows may jitter
_WHOLE = 4.0  # rows: a shorter leap over missing ones is a whole number of them, as far as that tells
_BY_CHANCE = 4.0  # times as many leaps of whole rows as of others: fewer are the jitter of a clock
_MOST = 0.95  # of the steps: as many are alike where rows are even, or a column counts
_WORDS = tuple(2.0**bits for bits in (8, 12, 16, 24, 31, 32))  # where counters wrap


def leapt_over(time: Array) -> tuple[str, ...]:
    """Return what to tell of rows that the clock of even rows leaps over."""
    usual = _usual(time)
    if not usual:
        return ()
    ratio = np.diff(time) / usual
    missing, few = np.round(ratio) - 1.0, ratio < _WHOLE
    late = few & (ratio > 1.0 + _EVEN) & (np.abs(ratio - np.round(ratio)) > _EVEN)
    if np.sum(few & (missing > 0.0) & ~late) <= _BY_CHANCE * np.sum(late):  # a clock that jitters makes as many
        late = few
    missing[late] = 0.0
    if not np.any(missing > 0.0):
        return ()
    k = int(np.argmax(missing > 0.0))
    return (
        f"{_said(time, missing)}: the clock goes on by {time[k + 1] - time[k]:.6g} s there, where rows are {usual:.6g} "
        "s apart. The input counts as held until the next row; where it moved meanwhile, split the file there and list "
        "both parts",
    )


def uncounted(time: Array, columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Return what to tell of rows that a column counts, and an even clock does not."""
    usual = _usual(time)
    for name, column in columns.items() if usual else ():
        ahead = _counts(column)
        if ahead is None or not np.any(ahead > 1.0):
            continue
        wraps = f", wraps = {_word(column):.0f}" if np.any(np.diff(column) < 0.0) else ""
        line = rename_line(name, "time_s", "s").removesuffix(" }")
        return (
            f"{_said(time, ahead - 1.0)}: {name} counts them, while time_s goes on as if nothing were, so that all "
            f"rows behind are too early. Let {name} be the clock, in place of time_s or recordings.period_s: in "
            f"[recordings.rename]\n  {line}, scale = {usual / float(np.median(np.diff(column))):.9g}{wraps} }}\n"
            '  time_s = "clock"',
        )
    return ()


def _usual(time: Array) -> float:
    """Return the time between rows that are even but for few; 0 where they are not."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    return usual if np.mean(np.abs(steps - usual) <= _EVEN * usual) >= _MOST else 0.0


def _counts(column: Array) -> Array | None:
    """Return by how many rows each is ahead of the one before; None where the column is no counter of rows."""
    steps = np.diff(column)
    each = float(np.median(steps))
    if each <= 0.0 or np.any(column != np.round(column)) or np.mean(steps == each) < _MOST:
        return None
    ahead = np.where(steps < 0.0, steps + _word(column), steps) / each
    return ahead if np.all(ahead > 0.0) and np.all(ahead == np.round(ahead)) else None


def _word(column: Array) -> float:
    return next((size for size in _WORDS if column.max() < size), _WORDS[-1])


def _said(time: Array, missing: Array) -> str:
    """Return how many rows are missing where."""
    at = np.flatnonzero(missing > 0.0)
    first = int(missing[at[0]])
    more = f" ({missing[at].sum():.0f} in {len(at)} such places)" if len(at) > 1 else ""
    return f"{first} row{'s are' if first > 1 else ' is'} missing after {time[at[0]]:.6g} s{more}"
