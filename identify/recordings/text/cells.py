"""Cells of a line: what is quoted is one, and what is a number, plain or in thousands, is told in one way."""

from __future__ import annotations

import csv
import re

from firmloop.identify.recordings.text.lines import Lines

_FORTRAN = re.compile(r"(?<![\w.])([-+]?(?:\d+\.\d*|\.\d+))[dD]([-+]?\d{1,3})(?![\w.])")  # 2.000D0
_NEAR_FORTRAN = re.compile(r"[dD](?<=[\d.].)")
_INSIDE = re.compile(r"\d'\d")  # a mark of thousands


def quoted_cells(line: str, delimiter: str) -> list[str]:
    """Split a line that has quotes; the whole line where a return stands inside of it, or a cell has no end."""
    try:
        return next(csv.reader([line.strip(" \r")], delimiter=delimiter))
    except csv.Error:
        return [line]


def split_cells(line: str, mark: str) -> list[str]:
    """Split a line at its marks, but for those within quotes."""
    return quoted_cells(line, mark) if '"' in line else line.split(mark)


def bare_cells(line: str, mark: str) -> list[str]:
    """Split a line into cells without the blanks and the quotes around them."""
    return [bare(cell) for cell in split_cells(line, mark)]


def grouped(mark: str) -> str:
    """Return the pattern of a whole number with one mark for thousands, such as 12,345; a + behind it takes more.

    `mark` is the pattern of one. No such number begins with 0: that is a fraction.
    """
    return rf"[-+]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})"


def is_number(cell: str) -> bool:
    """Tell whether a cell is a decimal number in ASCII, nan and inf among them; 1_000 is none."""
    try:
        float(cell)
    except ValueError:
        return False
    return cell.isascii() and "_" not in cell


def bare(cell: str) -> str:
    """Return a cell without the blanks and the quotes around it."""
    text = cell.strip().strip('"').strip()
    return text[1:-1].strip() if len(text) > 1 and text[0] == text[-1] == "'" else text


def double_quoted(lines: Lines) -> tuple[Lines, str]:
    """Write single quotes as double ones where most lines have a number in them; return what to tell, blank else."""
    if "'" not in lines.text:
        return lines, ""
    quoted = sum("'" in line and not _INSIDE.search(line) for line in lines)
    if 2 * quoted <= len(lines) or any('"' in line for line in lines):
        return lines, ""
    return Lines.of(line.replace("'", '"') for line in lines), "has values in single quotes"


def with_e(lines: Lines) -> tuple[Lines, str]:
    """Write exponents of Fortran, whose double precision has a D, with an E; return what to tell, blank else."""
    if not any(map(_FORTRAN.search, lines) if _NEAR_FORTRAN.search(lines.text) else ()):
        return lines, ""
    return Lines.of(_FORTRAN.sub(r"\1E\2", line) for line in lines), "has exponents with a D, as Fortran writes them"
