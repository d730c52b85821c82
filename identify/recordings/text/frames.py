"""Take from every line the marks that a message stands between: [1, 2], (1, 2), <1,2>, $1;2 and $1,2*5A."""

from __future__ import annotations

import re
from collections import Counter

from firmloop.identify.recordings.text.cells import is_number

_FRAME = re.compile(
    r"\s*([\[({<$!]*)\s*(.*?)\s*(?:(?<=\w)(\*)[0-9A-Fa-f]{2})?([\])}>]*)[,;]?\s*"
)  # NMEA 0183: * and a sum
_FEWEST = 3  # rows that make a table
_SHARE = 0.5  # of the lines: the others are words of the board
_PARTS = re.compile(r"[\s,;|]+")

_Marks = tuple[str, str]


def without_frames(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the text without the marks that stand around most of its rows, and what is told; the header may have none.

    A sum to check a row by goes with them.
    """
    lines = text.split("\n")
    marks = Counter(found[0] for line in lines if (found := _framed(line)) and _is_row(found[1]))
    (frame, count), filled = next(iter(marks.most_common(1)), (("", ""), 0)), sum(bool(line.strip()) for line in lines)
    if frame == ("", "") or count < _FEWEST or count <= _SHARE * filled:
        return text, ()
    bare = [found[1] if (found := _framed(line)) and found[0] == frame else line for line in lines]
    shown = " and ".join(filter(None, (frame[0], frame[1].replace("*", "* with a sum"))))
    return "\n".join(bare), (f"has {shown} around its rows, left aside",)


def _framed(line: str) -> tuple[_Marks, str] | None:
    """Return the marks around a line, and what stands between them."""
    found = _FRAME.fullmatch(line)
    return ((found[1], (found[3] or "") + found[4]), found[2]) if found else None


def _is_row(text: str) -> bool:
    return sum(map(is_number, _PARTS.split(text))) > 1
