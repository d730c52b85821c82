"""Cells of a line: what is quoted is one, and what is a number is told in one way."""

from __future__ import annotations

import csv


def quoted_cells(line: str, delimiter: str) -> list[str]:
    """Split a line that has quotes; the whole line where a return stands inside of it, or a cell has no end."""
    try:
        return next(csv.reader([line.strip(" \r")], delimiter=delimiter))
    except csv.Error:
        return [line]


def is_number(cell: str) -> bool:
    """Tell whether a cell is a decimal number in ASCII, nan and inf among them; 1_000 is none."""
    try:
        float(cell.replace("_", "?").encode("ascii", "replace"))
    except ValueError:
        return False
    return True
