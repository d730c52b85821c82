"""Read dates and times of day in a text as seconds from the first of them.

Only differences count. A date that is written year first is counted in days; of another one, whose day and month may be
either way round, nothing is taken but that it changes, and that is then midnight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date
from functools import lru_cache

from firmloop.identify.recordings.text.lines import Lines, last_filled

_DATE = r"\d{4}[-/.]\d\d[-/.]\d\d|\d{1,2}[-/.](?:\d{1,2}|[A-Za-z]{3})[-/.]\d{4}"
_CLOCK = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d(?:MARK\d+)?)"
    r"(?: ?(?P<half>[AaPp])[Mm])?(?: ?(?P<zone>Z|UTC|[-+]\d\d:?\d\d))?"
)
_STAMP = rf'"?(?<![\d:.])(?:(?P<date>{_DATE})(?:T| +))?{_CLOCK}(?![\d:])"?'
_ALONE = re.compile(rf'(?<![^,;\t"])"?(?:{_DATE})"?(?=[,;\t]|$)')  # a date in a column of its own
_TERMINAL = re.compile(
    rf"\s*(?:\[(?:{_DATE})?[T ]*\d+:\d\d:\d\d[.,:\d]*\]|(?:{_DATE})?[T ]*\d+:\d\d:\d\d[.,:\d]* ?->) ?"
)
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


def without_terminal_stamps(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the text without what a terminal has put before every line, such as 12:34:56.789 -> or [12:34:56]."""
    if not all(map(_TERMINAL.match, last_filled(text, 1))):
        return text, ()
    lines = [line for line in text.splitlines() if line.strip()]
    stamp = _TERMINAL.match(lines[0]) if len(lines) >= _FEWEST else None
    if stamp is None or not all(map(_TERMINAL.match, lines)):
        return text, ()
    bare = "\n".join(_TERMINAL.sub("", line) for line in text.splitlines())
    return bare, (f"has a stamp of the terminal before every line, left aside: {stamp.group().strip()!r}",)


def with_seconds(lines: Lines) -> tuple[Lines, str, int | None]:
    """Return the lines with seconds in place of the first stamp of each row, what is told of it, and its column.

    Rows are the lines of the shape that the last one has; where that has no stamp, all is left as it is.
    """
    last = next((line for line in reversed(lines) if line.strip()), "")
    mark = next((each for each in "\t;|," if each in last), " ")
    # Where a comma stands between columns it is no decimal mark.
    stamp = re.compile(_STAMP.replace("MARK", r"\." if mark == "," else "[.,]"))
    found = stamp.search(last)
    if found is None:
        return lines, "", None
    shape = _shape(last, found, mark)
    calendar, rows, example = _Calendar(), 0, ""

    def in_seconds(line: str) -> str:
        nonlocal rows, example
        match = stamp.search(line)
        if match is None or _shape(line, match, mark) != shape:
            return line
        rows, example = rows + 1, example or match.group().strip('"')
        before, after = line[: match.start()], line[match.end() :]
        alone = _ALONE.search(before) or _ALONE.search(after)
        seconds = f"{calendar.seconds(match, alone.group() if alone else ''):.9f}".rstrip("0").rstrip(".")
        return f"{_ALONE.sub('0', before)}{seconds}{_ALONE.sub('0', after)}"

    out = Lines.of(map(in_seconds, lines))
    if rows < _FEWEST:
        return lines, "", None
    return out, f"has stamps such as {example!r}, which are read as seconds from the first", shape[0]


def _shape(line: str, found: re.Match[str], mark: str) -> tuple[int, int]:
    """Return how many columns stand before and after a stamp."""
    before, after = line[: found.start()], line[found.end() :]
    if mark == " ":
        return len(before.split()), len(after.split())
    return before.count(mark), after.count(mark)


def _of_day(found: re.Match[str]) -> float:
    """Return the time of day, s; a zone that is told is taken out, as it may change in a file."""
    hour = int(found["hour"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"] in "Pp" else 0)
    seconds = float(found["second"].replace(",", "."))
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
