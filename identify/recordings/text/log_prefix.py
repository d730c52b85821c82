"""Take from every line what a library or a terminal puts before it, `I (312) MOTOR: `, `12:00:01,199 INFO ` or `> `."""

from __future__ import annotations

import re

from firmloop.identify.recordings.text.cells import is_number
from firmloop.identify.recordings.text.lines import last_filled

_WORD = re.compile(r"[^\W\d_]{2}|\b[A-Z] \(\d+\)")  # of a library; the letters of a stamp, T and Z, stand alone
_BEGIN = re.compile(r"(?:(?<!\d)[:>]|[\])|\s])\s*(?=[-+]?\.?\d)")  # behind which numbers begin: no part of a clock
_PROMPT = re.compile(r"\s*>+\s+")  # of a terminal, with no word in it
_COLOUR = re.compile(r"\x1b\[[\d;]*[A-Za-z]")
_FEWEST = 3  # rows that make a table
_MOST = 120  # letters of it
_AROUND = 60  # lines above and of a header, and below the last row
_SHARE = 0.5  # of the lines: the others are words of the program


def without_log_prefix(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the text without it, and what is told.

    It is what stands before the numbers of the last row, alike in most lines but for its digits. The header may have
    none, where a library wrote the rows alone; it has a name for each of their numbers, so that a column of words is no
    prefix. Colours of a terminal go with it.
    """
    if _COLOUR.search(text):
        bare, told = without_log_prefix(_COLOUR.sub("", text))
        return bare, ("has colours of a terminal, left aside", *told)
    found, mark, width = next(filter(None, map(_before_numbers, last_filled(text, _AROUND)[::-1])), ("", "", 0))
    if not found:
        return text, ()
    lines = text.splitlines()
    filled = [line for line in lines if line.strip()]
    if len(filled) < _FEWEST:
        return text, ()
    alike = re.compile(r"\s*" + r"\d+".join(_spaced(part) for part in re.split(r"\d+", found)))
    if sum(bool(alike.match(line)) for line in filled) <= _SHARE * len(filled):
        return text, ()
    above = [_cells(alike.sub("", line, count=1), mark) for line in filled[:_AROUND]]
    bare_first = alike.match(filled[0]) and all(map(is_number, above[0]))  # no header, which is then complained of
    if not bare_first and not any(len(cells) == width and not any(map(is_number, cells)) for cells in above):
        return text, ()
    bare = "\n".join(alike.sub("", line, count=1) for line in lines)
    return bare, (f"has what a log puts before each line, left aside: {found.strip()[:40]!r}",)


def _before_numbers(row: str) -> tuple[str, str, int] | None:
    """Return what stands before the numbers of a row, what parts them and how many they are; None where it has no word.

    Nor is it any where something else follows. The prompt of a terminal needs no word.
    """
    for begin in _BEGIN.finditer(row[:_MOST]):
        before, after = row[: begin.end()], row[begin.end() :]
        mark = next((each for each in ",;\t|" if each in after), " ")
        cells, parted = _cells(after, mark), re.search(r"[,;\t]", re.sub(r"\d,\d", "", before))
        if (
            (_WORD.search(before) or _PROMPT.fullmatch(before))
            and not parted
            and len(cells) > 1
            and all(map(is_number, cells))
        ):
            return before, mark, len(cells)
    return None


def _spaced(part: str) -> str:
    return r"\s*".join(map(re.escape, re.split(r"\s+", part)))


def _cells(line: str, mark: str) -> list[str]:
    return line.split() if mark == " " else line.strip().removesuffix(mark).split(mark)
