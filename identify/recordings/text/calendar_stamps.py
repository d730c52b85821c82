"""Read dates and times of day in a text as seconds from the first of them.

Only differences count. A date that is written year first is counted in days; of another one, whose day and month may be
either way round, nothing is taken but that it changes, and that is then midnight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import date
from functools import lru_cache

import numpy as np

from firmloop.identify.recordings.table import RawTable
from firmloop.identify.recordings.text.lines import Lines, last_filled

_DATE = r"\d{4}[-/.]\d\d[-/.]\d\d|\d{1,2}[-/.](?:\d{1,2}|[A-Za-z]{3})[-/.](?:\d{4}|\d\d)"
_CLOCK = (  # 12:00:01:250 has milliseconds
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d(?:MARK\d+|:\d{3})?))?"
    r"(?: ?(?P<half>[AaPp])[Mm])?(?: ?(?P<zone>Z|UTC|[-+]\d\d:?\d\d))?"
)
_STAMP = rf'"?(?<![\d:.])(?:(?P<date>{_DATE})(?:T| +))?{_CLOCK}(?![\d:])"?'
_ALONE = re.compile(rf'(?<![^,;\t"])"?(?:{_DATE})"?(?=[,;\t]|$)')  # a date in a column of its own
_TERMINAL = re.compile(
    rf"\s*(?:\[(?:{_DATE})?[T ]*\d+:\d\d:\d\d[.,:\d]*\]|(?:{_DATE})?[T ]*\d+:\d\d:\d\d[.,:\d]* ?->"
    rf"|(?:{_DATE})[T ]\d+:\d\d:\d\d[.,:\d]* +(?![AaPp][Mm])(?=[^\s,;]+[,;]\S*\s*$)) ?"
)
_QUOTED = re.compile('"[^"]*"')
_DAY = 86400.0  # s
_FEWEST = 3  # rows that make a table


@dataclass(slots=True)
class _Calendar:
    """Counts stamps in s from the first one, across midnight."""

    first: tuple[int, float] | None = None  # day, s
    last: float = 0.0
    day: int = 0
    date: str = ""

    def seconds(self, found: re.Match[str], alone: str) -> float:
        """Return how long after the first stamp this one is; `alone` is a date in a column of its own."""
        written = found["date"] or alone
        at, counted = _of_day(found), _counted_days(written)
        if counted is not None:
            self.day = counted
        elif self.first is not None:
            # Without a date only midnight takes a clock back by more than half a day.
            self.day += int(written != self.date if written else at < self.last - _DAY / 2)
        self.date, self.last = written, at
        self.first = self.first or (self.day, at)
        return _DAY * (self.day - self.first[0]) + (at - self.first[1])


def without_terminal_stamps(text: str) -> tuple[str, tuple[float, ...]]:
    """Return the text without what a terminal has put before every line, such as 12:34:56.789 -> or [12:34:56].

    Also when that was, in s from the first, line by line: nothing where there are none. A header may have been written
    above them.
    """
    if not all(map(_TERMINAL.match, last_filled(text, 1))):
        return text, ()
    lines = text.splitlines()
    filled = [line for line in lines if line.strip()]
    if len(filled) < _FEWEST or not all(map(_TERMINAL.match, filled[1:])):
        return text, ()
    clock, calendar, at = re.compile(_STAMP.replace("MARK", "[.,]")), _Calendar(), [0.0]
    for line in lines:
        before = _TERMINAL.match(line)
        stamp = clock.search(before.group()) if before else None
        at.append(calendar.seconds(stamp, "") if stamp else at[-1])
    return "\n".join(_TERMINAL.sub("", line, count=1) for line in lines), tuple(at[1:])


def with_terminal_stamps(table: RawTable, at: tuple[float, ...], timed: bool) -> RawTable:
    """Put the time at which a terminal got each line before its columns, where none of them is the time."""
    told = "has a stamp of the terminal before every line"
    if timed or table.place != "line" or not any(at):
        return replace(table, notes=(f"{told}, left aside", *table.notes))
    stamps = np.array(at)[table.places - 1]
    return replace(
        table,
        names=("stamp", *table.names),
        columns=(stamps - stamps[0], *table.columns),
        units=("s", *(table.units or ("",) * len(table.names))),
        notes=(f"{told}, which is in the column stamp as seconds from the first", *table.notes),
    )


def with_seconds(lines: Lines) -> tuple[Lines, str, int | None]:
    """Return the lines with seconds in place of the first stamp of each row, what is told of it, and its column.

    Rows are the lines of the shape that the last one has; where that has no stamp, all is left as it is.
    """
    last = next((line for line in reversed(lines) if line.strip()), "")
    mark = next((each for each in "\t;|," if each in last), " ")
    # Where a comma stands between columns it is no decimal mark.
    stamp = re.compile(_STAMP.replace("MARK", r"\." if mark == "," else "[.,]"))
    found = _found(stamp, last)
    if found is None:
        return lines, "", None
    shape = _shape(last, found, mark)
    calendar, rows, example = _Calendar(), 0, ""

    def in_seconds(line: str) -> str:
        nonlocal rows, example
        match = _found(stamp, line)
        if match is None or _shape(line, match, mark) != shape:
            return line
        rows, example = rows + 1, example or match.group().strip('"')
        before, after = line[: match.start()], line[match.end() :]
        alone = _alone(line, match)
        seconds = f"{calendar.seconds(match, alone.group() if alone else ''):.9f}".rstrip("0").rstrip(".")
        return f"{_ALONE.sub('date', before)}{seconds}{_ALONE.sub('date', after)}"

    out = Lines.of(map(in_seconds, lines))
    if rows < _FEWEST:
        return lines, "", None
    return out, f"has stamps such as {example!r}, which are read as seconds from the first", shape[0]


def first_row_first(table: RawTable, stamped: int | None) -> RawTable:
    """Return the table with its rows in order, where its dates, which no clock counts down, go back in every row."""
    steps = np.diff(table.columns[stamped]) if stamped is not None else np.zeros(0)
    if stamped is None or not np.any(steps < 0.0) or np.any(steps > 0.0):
        return table
    turned = table.turned_around()
    time = turned.columns[stamped]
    columns = [time - time[0] if k == stamped else column for k, column in enumerate(turned.columns)]
    return replace(turned, columns=tuple(columns))


def _found(stamp: re.Pattern[str], line: str) -> re.Match[str] | None:
    """Return the first stamp; beside a date 12:00 is hours and minutes, alone it may be minutes and seconds."""
    found = stamp.search(line)
    whole = found is not None and (found["second"] or found["date"] or _alone(line, found))
    return found if whole else None


def _alone(line: str, found: re.Match[str]) -> re.Match[str] | None:
    return _ALONE.search(line[: found.start()]) or _ALONE.search(line[found.end() :])


def _shape(line: str, found: re.Match[str], mark: str) -> tuple[int, int]:
    """Return how many columns stand before and after a stamp."""
    before, after = (_QUOTED.sub("", part) for part in (line[: found.start()], line[found.end() :]))
    if mark == " ":
        return len(before.split()), len(after.split())
    return before.count(mark), after.count(mark)


def _of_day(found: re.Match[str]) -> float:
    """Return the time of day, s; a zone that is told is taken out, as it may change in a file."""
    hour = int(found["hour"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"] in "Pp" else 0)
    seconds = float(re.sub("[,:]", ".", found["second"] or "0"))
    return 3600.0 * hour + 60.0 * int(found["minute"]) + seconds - _ahead(found["zone"] or "")


@lru_cache(1024)
def _ahead(zone: str) -> float:
    """Return by how much a zone such as +01:00 is ahead, s."""
    digits = re.sub(r"\D", "", zone)
    ahead = 3600.0 * int(digits[:2]) + 60.0 * int(digits[2:]) if digits else 0.0
    return -ahead if zone.startswith("-") else ahead


@lru_cache(1024)
def _counted_days(text: str) -> int | None:
    try:
        return date.fromisoformat(re.sub("[/.]", "-", text.strip('"'))).toordinal()
    except ValueError:
        return None
