"""Take the marks between thousands out of numbers such as 1,234.5, where no other reading of them is left."""

from __future__ import annotations

import re
from functools import partial

from firmloop.identify.recordings.table import Misread
from firmloop.identify.recordings.text.cells import grouped, split_cells
from firmloop.identify.recordings.text.lines import Lines

_BLANK = "[ \u00a0\u2009\u202f]"
_WAYS = ((",", "."), (".", ","), ("['\u2019]", "."), ("['\u2019]", ","), (_BLANK, "."), (_BLANK, ","))
_SAID = {",": "commas", ".": "points"}
_NO_NUMBER = ("nan", "inf", "infinity")  # that is read as one


def without_thousands(lines: Lines) -> tuple[Lines, str] | Misread:
    """Return the lines without such marks and quotes around numbers, and what is told of it.

    A mark is sure where a number has two of them, or one and a decimal mark. A comma or a point alone may be either:
    the other numbers decide it: those of its own column, or all of them where commas part the columns.
    Only lines that have words where the last one has them are rows: headers and what stands above them are not.
    """
    last = next((line for line in reversed(lines) if line.strip()), "")
    bare = re.sub('"[^"]*"', "", last)
    delimiter = next((each for each in "\t;|," if each in bare), "")
    if not delimiter:
        return lines, ""
    words = _words(_cells(last, delimiter))
    unquoted = lines.text.replace('"', "")
    parts = () if '"' in lines.text else (delimiter,)  # what stands in no number
    spaced = delimiter == "," and re.search(rf"\d{_BLANK}+[-+\d]", bare)  # 0,001 6,000: blanks may part columns
    wrong = None
    for mark, point in _WAYS[:4] if spaced else _WAYS:
        if mark in parts:
            continue
        between = mark if mark.startswith("[") else re.escape(mark)
        once = grouped(between)
        end = rf"(?:{re.escape(point)}\d*)?"
        alone = "" if mark in _SAID else rf"|{once}+{end}"
        sure = re.compile(rf"{once}+{re.escape(point)}\d+|{once}{{2,}}{end}{alone}")
        near = rf"{between}(?<=\d.)\d{{3}}"  # such a number has it, and hardly a file without them
        if not alone:
            near += rf"{between}\d{{3}}" if point in parts else rf"(?:{re.escape(point)}\d|{between}\d{{3}})"
        held = map(partial(_cells, delimiter=delimiter), lines) if re.search(near, unquoted) else ()
        told_by_others = not any(any(map(sure.fullmatch, cells)) for cells in held if _words(cells) == words)
        if told_by_others and not (mark in _SAID and _decided(lines, delimiter, words, (mark, point))):
            continue
        number = re.compile(rf"{once}+{end}|[-+]?\d*{end}(?:[eE][-+]?\d+)?")
        out = list(lines)
        for k, line in enumerate(lines):
            cells = _cells(line, delimiter)
            if not any(cells) or _words(cells) != words:
                continue
            odd = [cell for cell in cells if not (number.fullmatch(cell) or _is_word(cell) or _is_no_number(cell))]
            if odd and told_by_others:
                break
            if odd:
                says = f"is {odd[0][:40]!r}, where other numbers have {_SAID.get(mark, 'marks')} between thousands"
                wrong = wrong or Misread(f"line {k + 1}", says, "save the file without marks for thousands")
                break
            out[k] = delimiter.join(
                cell.replace(delimiter, " ") if _is_word(cell) else re.sub(between, "", cell).replace(point, ".")
                for cell in cells
            )
        else:
            return Lines.of(out), f"has {_SAID.get(mark, 'marks')} between thousands, left out"
    return wrong or (lines, "")


def _decided(lines: Lines, delimiter: str, words: list[int], marks: tuple[str, str]) -> bool:
    """Tell whether other numbers have the second mark as the decimal one, and none in the file has the first.

    They are those of the columns in which a number has the first mark once; all, where that and `delimiter` are commas.
    """
    mark, point = map(re.escape, marks)
    fraction = r"[-+]?(?:(?:0|[1-9]\d{{3,}})?{0}\d+|\d+{0}(?:\d{{0,2}}|\d{{4,}}))(?:[eE][-+]?\d+)?"
    against, decides = re.compile(fraction.format(mark)), re.compile(fraction.format(point))
    once = re.compile(grouped(mark))
    if not re.search(rf"{mark}(?<=\d.)\d{{3}}(?!\d)", lines.text.replace('"', "")):
        return False
    found: set[int] = set()
    columns: set[int] = set()
    for line in lines:
        cells = _cells(line, delimiter)
        if _words(cells) != words:
            continue
        if any(map(against.fullmatch, cells)):
            return False
        columns.update(j for j, cell in enumerate(cells) if once.fullmatch(cell))
        found.update(j for j, cell in enumerate(cells) if decides.fullmatch(cell))
    return bool(columns) and bool(found if marks[0] == delimiter == "," else found & columns)


def _words(cells: list[str]) -> list[int]:
    """Return which cells hold words, after how many there are."""
    return [len(cells), *(k for k, cell in enumerate(cells) if _is_word(cell))]


def _is_word(cell: str) -> bool:
    return re.search(r"[^\W\d_eE]", cell) is not None and not _is_no_number(cell)


def _is_no_number(cell: str) -> bool:
    return cell.lower().lstrip("+-") in _NO_NUMBER


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in split_cells(line, delimiter)]
