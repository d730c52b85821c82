"""Add fractions of a second that a file has in a column of their own to the whole seconds before them."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np

from firmloop.identify.recordings.table import RawTable

_SECONDS = ("sec", "secs", "second", "seconds")
_FRACTIONS = {
    **dict.fromkeys(("ms", "msec", "millis", "millisec", "milliseconds"), 1e3),
    **dict.fromkeys(("us", "usec", "micros", "microsec", "microseconds"), 1e6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanos", "nanosec", "nanoseconds"), 1e9),
}


def with_fractions(table: RawTable, stamped: int | None = None) -> RawTable:
    """Add what stands in a column of milliseconds, or smaller, behind one of whole seconds.

    So write Graphtec's recorders, behind a stamp, which is the column `stamped`, and the headers of ROS.
    """
    for k, (name, behind) in enumerate(pairwise(table.names)):
        ticks = _FRACTIONS.get(_last_word(behind).replace("\u00b5", "u").replace("\u03bc", "u"), 0.0)
        whole, part = table.columns[k : k + 2]
        if not (ticks and (k == stamped or _last_word(name) in _SECONDS) and np.all(whole == np.round(whole))):
            continue
        if not np.all((part >= 0.0) & (part < ticks)) or not np.any(part):
            continue
        columns, units = [*table.columns], [*(table.units or ("",) * len(table.names))]
        columns[k], units[k] = whole - whole[0] + (part - part[0]) / ticks, "s"
        kept = [j for j in range(len(table.names)) if j != k + 1]
        told = f"has the fraction of each second in the column {behind}, which is added to {name}, from the first"
        return replace(
            table,
            names=tuple(table.names[j] for j in kept),
            columns=tuple(columns[j] for j in kept),
            units=tuple(units[j] for j in kept),
            notes=(*table.notes, told),
        )
    return table


def _last_word(name: str) -> str:
    return (re.split(r"[\W_]+", name.strip()) or [""])[-1].lower()
