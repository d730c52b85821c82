"""Tell in which unit a clock counts that names none: s, or since when it counts ms, us, ns or days."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.columns import Column, rename_line

Array = NDArray[np.float64]

_SECONDS_MOST = 1e5  # span, a day or so: a clock without a unit that runs further counts smaller ticks
_MICROSECONDS = 500.0  # ticks a row from which such a clock counts microseconds
_EPOCHS = ((1e12, "ms"), (1e15, "us"), (1e18, "ns"))  # ticks since 1970, from the year 2001 to 2096
_CALENDARS = ((36526.0, 73051.0), (730486.0, 767011.0))  # days since 1900 and since the year 0, from 2000 to 2100
_DAY = 86400.0  # s
_QUICK, _UNEVEN = 1e-3, 0.2  # days from row to row, and by how much of them rows differ that keep to no grid
_SET, _PRINTED = 1e-6, 2e-3  # of a step, by which one of two digits differs from what stamps print, in s and in days
_DATE = re.compile("(?i)date|datum|fecha|data$|serial")


def tick_of(values: Array, name: str) -> str:
    """Return the unit of a clock called `name` that says none."""
    if found := since(values, name):
        return found
    if np.any(values != np.round(values)) or float(np.ptp(values)) < _SECONDS_MOST:
        return "s"
    return "us" if float(np.median(np.diff(values))) >= _MICROSECONDS else "ms"


def since(values: Array, name: str) -> str:
    """Return the unit of a clock that counts from 1970, or days as spreadsheets and MATLAB do; empty where it may be s.

    Days have a fraction, and a step that somebody has set: few digits in s, and many in days. Without a grid they have
    a short one, and a column that is called a date has nothing but days.
    """
    first, steps = float(values[0]), np.diff(evened(values))
    if epoch := next((unit for least, unit in _EPOCHS if least <= first < 4.0 * least), ""):
        return epoch
    within = any(low <= first and float(values[-1]) < high for low, high in _CALENDARS)
    if not within or not len(steps) or not np.any(values != np.round(values)):
        return ""
    step = float(np.median(steps))
    loose = float(np.ptp(steps)) > _UNEVEN * step and step < _QUICK
    in_days = not _is_set(step, _SET) and (loose or _is_set(_DAY * step, _PRINTED))
    return "days" if _DATE.search(name) or in_days else ""


def check_tick(values: Array, printed: str, given: tuple[str, Column], file: str) -> None:
    """Refuse a clock (n,) that is taken for one of seconds, and counts something else since a day that is known.

    `printed` is its unit by the file; `given` its name there, and how the project reads it.

    Raises
    ------
    IdentifyError
        with the line that gives its unit.
    """
    foreign, rule = given
    if printed or rule.unit or rule.scale != 1.0 or not len(values) or not (unit := since(values, foreign)):
        return
    what = "days, as spreadsheets and MATLAB count them" if unit == "days" else f"{unit} since 1970"
    raise IdentifyError(
        f"{file}: column {foreign}: its stamps, {values[0]:.15g} and so on, look like {what}, and are read as seconds; "
        'write in which unit they are (unit = "s" if they are seconds)',
        f"[recordings.rename]\n{rename_line(foreign, 'time_s', unit)}",
    )


def _is_set(step: float, off: float) -> bool:
    """Tell whether a step has two digits at most, but for what stamps are `off`."""
    return step > 0.0 and abs(float(f"{step:.1e}") / step - 1.0) < off
