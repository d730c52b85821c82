"""Read comma-separated text, fast while it is well formed, and name the first culprit where it is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.table import Misread, RawTable


def read_csv(content: bytes) -> RawTable | Misread:
    """Parse a header line and rows of numbers; blank lines are skipped, line numbers count them."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return Misread(f"byte {error.start}", "is not text", "save the recording as UTF-8 comma-separated text")
    if "\0" in text:
        return Misread(f"byte {text.index(chr(0))}", "is not text", "save the recording as comma-separated text")
    lines = [line.strip() for line in text.split("\n")]
    numbers = np.array([number for number, line in enumerate(lines, 1) if line], dtype=np.int64)
    if not len(numbers):
        return Misread("", "is empty", "write one header line (time_s, then the signals) and one line per sample")
    names = tuple(name.strip().strip('"') for name in lines[numbers[0] - 1].split(","))
    if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
        return Misread("the header", "is not separated by commas", "save with ',' between columns and '.' in numbers")
    if len(numbers) == 1:
        return Misread("", "has a header but no rows", "write one line per sample below the header")
    rows = [line for line in lines[numbers[0] :] if line]
    try:
        values = np.loadtxt(rows, delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        return _culprit(names, rows, numbers[1:], str(error))
    if values.shape[1] != len(names):
        return _culprit(names, rows, numbers[1:], f"{values.shape[1]} values below {len(names)} names")
    return RawTable(names, tuple(np.ascontiguousarray(column) for column in values.T), "line", numbers[1:])


def _culprit(names: tuple[str, ...], rows: list[str], numbers: NDArray[np.int64], says: str) -> Misread:
    """Go through the rows one by one until one does not parse; only called when the fast way failed."""
    for number, row in zip(numbers, rows, strict=True):
        cells = row.split(",")
        if len(cells) != len(names):
            wrong = f"has {len(cells)} values where the header names {len(names)} columns"
            return Misread(f"line {number}", wrong, "complete the row or delete it")
        for name, cell in zip(names, cells, strict=True):
            try:
                float(cell.strip().strip('"').replace("_", "?"))
            except ValueError:
                wrong = f"is {cell.strip()[:40]!r}, not a number" if cell.strip() else "is empty"
                return Misread(f"line {number}, column {name}", wrong, "write a number with '.' or delete the row")
            if cell.strip().startswith('"'):
                wrong = f"is {cell.strip()[:40]!r}, a number in quotes"
                return Misread(f"line {number}, column {name}", wrong, "write numbers without quotes")
    return Misread("", f"cannot be parsed: {says}", "write plain decimal numbers separated by commas")


FORMAT = Format((".csv",), read_csv)
