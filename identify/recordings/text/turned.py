"""Turn a table around whose lines are its columns: a name, and behind it every value of one signal."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.recordings.columns import tells_time
from firmloop.identify.recordings.text.cells import bare, is_number
from firmloop.identify.recordings.text.lines import Lines

_MOST = 100  # signals: a file of more lines is no such table
_FEWEST = 4  # values behind each name


def turned(lines: Sequence[str]) -> tuple[Lines, str] | None:
    """Return the lines with a row for each time, and what to tell of it; None where lines are rows."""
    if len(lines) > _MOST:
        return None
    said = [line for line in lines if line.strip()]
    mark = next((each for each in "\t;," if said and each in said[0]), "")
    table = [[bare(cell) for cell in line.strip().rstrip(mark).split(mark)] for line in said] if mark else []
    if len(table) < 2 or min(map(len, table)) < 1 + _FEWEST or len({*map(len, table)}) > 1:
        return None
    plain = [[row[0], *(cell.replace(",", ".") for cell in row[1:])] for row in table]
    numbers = all(is_number(cell) for row in plain for cell in row[1:])
    if not numbers or any(is_number(row[0]) or not row[0] for row in plain) or not tells_time(plain[0][0]):
        return None
    return Lines.of(map(mark.join, zip(*plain, strict=True))), "has a signal in each line, and is turned around"
