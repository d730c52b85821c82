"""Cells of a line: what is quoted is one, and what is a number, plain or in thousands, is told in one way."""

from __future__ import annotations

import csv


def quoted_cells(line: str, delimiter: str) -> list[str]:
    """Split a line that has quotes; the whole line where a return stands inside of it, or a cell has no end."""
    try:
        return next(csv.reader([line.strip(" \r")], delimiter=delimiter))
    except csv.Error:
        return [line]


def grouped(mark: str) -> str:
    """Return the pattern of a whole number with one mark for thousands, such as 12,345; a + behind it takes more.

    `mark` is the pattern of one. No such number begins with 0: that is a fraction.
    """
    return rf"[-+]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})"


def is_number(cell: str) -> bool:
    """Tell whether a cell is a decimal number in ASCII, nan and inf among them; 1_000 is none."""
    try:
        float(cell.replace("_", "?").encode("ascii", "replace"))
    except ValueError:
        return False
    return True
