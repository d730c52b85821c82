"""Take the marks between thousands out of numbers such as 1,234.5, where no other reading of them is left."""

from __future__ import annotations

import csv
import re

from firmloop.identify.recordings.table import Misread

_BLANKS = " \u00a0\u2009\u202f"
_WAYS = ((",", "."), (".", ","), ("['\u2019]", "."), ("['\u2019]", ","), (f"[{_BLANKS}]", "."), (f"[{_BLANKS}]", ","))
_SAID = {",": "commas", ".": "points"}
_TELLING = re.compile(rf"\d[,.'\u2019{_BLANKS}]\d{{3}}(?!\d)")


def without_thousands(lines: list[str]) -> tuple[list[str], str] | Misread:
    """Return the lines without such marks and quotes around numbers, and what is told of it.

    A mark is sure where a number has two of them, or one and a decimal mark; a comma alone may be either.
    """
    last = next((line for line in reversed(lines) if line.strip()), "")
    delimiter = next((each for each in "\t;|," if each in re.sub('"[^"]*"', "", last)), "")
    told = [k for k, line in enumerate(lines) if _TELLING.search(line)] if delimiter else []
    rows = {k: _cells(lines[k], delimiter) for k in told}
    for mark, point in _WAYS:
        between = mark if mark.startswith("[") else re.escape(mark)
        once = rf"[-+]?[1-9]\d{{0,2}}(?:{between}\d{{3}})"
        end = rf"(?:{re.escape(point)}\d*)?"
        alone = "" if mark in _SAID else rf"|{once}+{end}"
        sure = re.compile(rf"{once}+{re.escape(point)}\d+|{once}{{2,}}{end}{alone}")
        if not any(sure.fullmatch(cell) for row in rows.values() for cell in row):
            continue
        grouped, plain = re.compile(rf"{once}+{end}"), re.compile(rf"[-+]?\d*{end}(?:[eE][-+]?\d+)?")
        out = list(lines)
        for k, line in enumerate(lines):
            cells = rows.get(k) or _cells(line, delimiter)
            if not any(cells) or any(re.search(r"[^\W\d_eE]", cell) for cell in cells):
                continue  # a header, or words
            odd = [cell for cell in cells if not (grouped.fullmatch(cell) or plain.fullmatch(cell))]
            if odd:
                wrong = f"is {odd[0][:40]!r}, where other numbers have {_SAID.get(mark, 'marks')} between thousands"
                return Misread(f"line {k + 1}", wrong, "save the file without marks for thousands")
            out[k] = delimiter.join(re.sub(between, "", cell).replace(point, ".") for cell in cells)
        return out, f"has {_SAID.get(mark, 'marks')} between thousands, left out"
    return lines, ""


def _cells(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line.strip(" \r")], delimiter=delimiter))]
    except csv.Error:
        return [line]
