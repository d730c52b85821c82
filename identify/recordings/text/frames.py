"""Take from every line the marks that a message stands between: [1, 2], (1, 2), <1,2>, $1;2 and $1,2*5A."""

from __future__ import annotations

import re
from collections import Counter

from firmloop.identify.recordings.text.cells import is_number
from firmloop.identify.recordings.text.lines import Lines

_OPEN, _CLOSE, _BEHIND = "[({<$!", "])}>", " \t\r,;"
_SUM = re.compile(r"\w\*[0-9A-Fa-f]{2}")  # of NMEA 0183, behind a value
_FEWEST = 3  # rows that make a table
_SHARE = 0.5  # of the lines: the others are words of the board
_PARTS = re.compile(r"[\s,;|]+")

_Marks = tuple[str, str]


def without_frames(lines: Lines) -> tuple[Lines, tuple[str, ...]]:
    """Return the lines without the marks that stand around most rows, and what is told; the header may have none.

    A sum to check a row by goes with them.
    """
    count = sum(map(lines.text.count, f"{_OPEN}{_CLOSE}*"))  # at most so many lines have any
    if count < _FEWEST or count <= _SHARE * (filled := sum(bool(line.strip()) for line in lines)):
        return lines, ()
    marks = Counter(frame for frame, inner in map(_framed, lines) if _is_row(inner))
    frame, count = next(iter(marks.most_common(1)), (("", ""), 0))
    if frame == ("", "") or count < _FEWEST or count <= _SHARE * filled:
        return lines, ()
    bare = (inner if found == frame else line for line, (found, inner) in ((line, _framed(line)) for line in lines))
    shown = " and ".join(filter(None, (frame[0], frame[1].replace("*", "* with a sum"))))
    return Lines.of(bare), (f"has {shown} around its rows, left aside",)


def _framed(line: str) -> tuple[_Marks, str]:
    """Return the marks around a line, and what stands between them."""
    bare = line.strip().rstrip(_BEHIND)
    inner = bare.lstrip(_OPEN)
    core = inner.rstrip(_CLOSE)
    begin, end = bare[: len(bare) - len(inner)], inner[len(core) :]
    if _SUM.fullmatch(core[-4:]):
        core, end = core[:-3], f"*{end}"
    return (begin, end), core.strip()


def _is_row(text: str) -> bool:
    return sum(map(is_number, _PARTS.split(text))) > 1
