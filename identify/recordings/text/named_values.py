"""Read lines such as t_ms:12,speed:3.5 or `I (1300) HEATER: duty=0.8 temp=25.1 C`: a name before each value.

Plotters of serial lines, the logs of ESP-IDF, Klipper and ROS write so. What stands before the first name is the log's:
a number in it that rises is a stamp, and the time where no value is called so.
"""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.printed_units import is_unit
from firmloop.identify.recordings.columns import called_a_time
from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.recordings.text.calendar_stamps import with_seconds
from firmloop.identify.recordings.text.chatter import listed_lines
from firmloop.identify.recordings.text.lines import Lines

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan"
_PAIR = re.compile(
    rf"[\s,;>|]*([A-Za-z_][\w .()/\[\]%]*?)\s*[:=]\s*({_NUMBER})( ?(?!nan)[^\W\d][\w/^*]*|%)?(?=[\s,;|]|$)(?!\s*[:=])"
)
_SECTION = re.compile(r"([A-Za-z_]\w*):\s")
_STAMP = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])")
_MILLISECONDS = re.compile(r"[A-Z] \(\d+\)")  # of ESP-IDF
_FEWEST, _SHARE = 3, 0.25  # rows, and share of the lines, that make a table
_LOOKED = 1000  # lines, among which one names its values where any does
_LONGEST = 4000  # characters of a line of a log
_WHOLE = 0.5  # of the lines that name values: the others are parts of another table

Array = NDArray[np.float64]
Line = tuple[int, str, tuple[tuple[str, str, str], ...]]  # number, what stands before, name, value and unit of each


def read_named_values(lines: Lines) -> RawTable | Misread | None:
    """Return a row for each line that names the values most lines name; None for another kind of text."""
    if not any(len(_pairs(line)) > 1 for line in islice(lines, _LOOKED)):
        return None
    told = ["has a name before each value, as plotters of serial lines read them"]
    seconds, stamps, _ = with_seconds(lines)
    named = [_named(k + 1, line) for k, line in enumerate(seconds) if line.strip()]
    found = [each for each in named if len(each[2]) > 1]
    filled = sum(bool(line.strip()) for line in lines)
    counted = Counter(tuple(name for name, *_ in pairs) for *_, pairs in found).most_common(1)
    names, count = counted[0] if counted else ((), 0)
    if count < max(_FEWEST, _SHARE * filled) or count < _WHOLE * len(found):
        return None
    rows = [each for each in found if tuple(name for name, *_ in each[2]) == names]
    if len(set(names)) < len(names):
        return None
    columns = [np.array([float(pairs[k][1]) for *_, pairs in rows]) for k in range(len(names))]
    units = [_unit({pairs[k][2].strip() for *_, pairs in rows}) for k in range(len(names))]
    clocked = any(called_a_time(name) and _rises(column) for name, column in zip(names, columns, strict=True))
    time = None if clocked else _stamps(rows)
    if time is not None:
        names, columns, units = ("time_s", *names), [time, *columns], ["s", *units]
        told.append(stamps or "has a stamp before them, which is taken for time_s")
    whole = {place for place, *_ in rows}
    torn = [place for place, _, pairs in named if place not in whole and any(pair[0] in names for pair in pairs)]
    if torn and time is None and not clocked:
        wrong = f"does not name {', '.join(names[:9])}, as most lines do"
        return Misread(f"line {torn[0]}", wrong, "complete the line or delete it; keep the others")
    if aside := [k + 1 for k, line in enumerate(lines) if line.strip() and k + 1 not in whole]:
        which = f"{len(aside)} line{'s do' if len(aside) > 1 else ' does'} not name them, left aside: line"
        told.append(f"{which} {listed_lines(aside)}")
    places = np.array(sorted(whole), dtype=np.int64)
    return RawTable(names, tuple(columns), "line", places, tuple(units) if any(units) else (), (", ".join(told),))


def _pairs(line: str) -> list[re.Match[str]]:
    """Return the names with their values; none of a line that is no log's, of which a search takes the square."""
    return list(_PAIR.finditer(line)) if len(line) <= _LONGEST else []


def _named(place: int, line: str) -> Line:
    """Return the values of a line by their names; one that comes again is told by the section it stands in."""
    pairs = _pairs(line)
    names = [pair[1] for pair in pairs]
    sections = [(each.start(), each[1]) for each in _SECTION.finditer(line) if each[1] not in names]
    made = []
    for pair in pairs:
        name = pair[1]
        if names.count(name) > 1:
            within = [called for start, called in sections if start < pair.start(1)]
            name = f"{within[-1]}_{name}" if within else name
        made.append((name, pair[2], pair[3] or ""))
    return place, line[: pairs[0].start(1)] if pairs else "", tuple(made)


def _unit(written: set[str]) -> str:
    unit = next(iter(written)) if len(written) == 1 else ""
    return unit if unit and is_unit(unit) else ""


def _stamps(rows: list[Line]) -> Array | None:
    """Return the number before the first name that never falls, s; None where there is none."""
    numbers = [_STAMP.findall(before) for _, before, _ in rows]
    if len({len(each) for each in numbers}) > 1:
        return None
    for column in np.array(numbers, dtype=np.float64).T:
        if _rises(column):
            return np.asarray(column / 1000.0 if _MILLISECONDS.match(rows[0][1]) else column)
    return None


def _rises(column: Array) -> bool:
    return bool(np.all(np.diff(column) >= 0.0) and column[-1] > column[0])
