"""Take the unit out of each reading of a column that is written with it: 3.2 V, 500mV, 12,5 °C."""

from __future__ import annotations

import re

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, is_unit
from firmloop.identify.recordings.table import Misread
from firmloop.identify.recordings.text.cells import bare_cells, is_number
from firmloop.identify.recordings.text.lines import Lines, last_filled

_MARKS = ("\t", ";", "|", ",")
_READING = re.compile(r"([-+]?(?:\d[\d.,'\u2019 ]*|\.\d+)(?:(?<=[\d.,])[eE][-+]?\d+)?)[ \u00a0\u2009\u202f]*(\S.*)")
_COUNT_A_TIME = re.compile(r"([-+\d.,]+)\s+(1/\w+)")  # 100 1/min: the second number is of the unit
_APART = re.compile(r"(?<=[\d.,])[ \u00a0]+(?=[^\W\d_]|[\u00b0%\u03a9])")
_FEWEST = 3  # rows that make a table
_MOST = 0.5  # of the rows: fewer readings with a unit are slips
_LONGEST = 12  # letters of a unit

Reading = tuple[str, str]  # the number as it is written, and its unit


def without_reading_units(lines: Lines) -> tuple[Lines, dict[int, str], str] | Misread:
    """Return the lines with bare numbers, the unit of each such column by its place, and what is told of it.

    Rows have as many cells as the last lines. Where a meter has changed its range in between, readings become those in
    the unit of the first; without a unit, or with one of another kind, a reading is told and nothing is read.
    """
    ends = last_filled(lines.text, _FEWEST) or [""]  # of which the last may be torn
    mark = next((each for each in _MARKS if each in re.sub('"[^"]*"', "", ends[0])), " ")
    last = max(ends, key=lambda line: len(_cells(line, mark)))
    width = len(_cells(last, mark))
    held = [k for k, cell in enumerate(_cells(last, mark)) if reading_of(cell)] if width > 1 else []
    if not held:
        return lines, {}, ""
    rows = {k: cells for k, line in enumerate(lines) if len(cells := _cells(line, mark)) == width}
    units: dict[int, str] = {}
    for column in held:
        read = {k: found for k, cells in rows.items() if (found := reading_of(cells[column]))}
        if len(read) <= _MOST * len(rows):
            continue
        units[column] = unit = next(iter(read.values()))[1]
        for k, cells in rows.items():
            if k in read:
                cells[column] = number = _in_unit(*read[k], unit)
                if not number:
                    wrong = f"is in {read[k][1]}, and the first reading of column {column + 1} in {unit}"
                    return Misread(f"line {k + 1}", wrong, "write one quantity a column; keep the rows")
            elif k > min(read) and is_number(cells[column].replace(",", ".")):
                wrong = f"is {cells[column]!r} in column {column + 1}, without the unit of its other readings, {unit}"
                return Misread(f"line {k + 1}", wrong, f"write {unit} behind it if it is in that; keep the rows")
            elif k > min(read):  # OL V, an overload
                cells[column] = cells[column].removesuffix(unit).strip()
    if not units:
        return lines, {}, ""
    out = (mark.join(_quoted(cell, mark) for cell in rows[k]) if k in rows else line for k, line in enumerate(lines))
    return Lines.of(out), units, f"has a unit behind each reading, which is taken: {', '.join(units.values())}"


def reading_of(cell: str) -> Reading | None:
    """Return a number and the unit behind it; None where a cell is anything else."""
    found = _COUNT_A_TIME.fullmatch(cell) or _READING.fullmatch(cell)
    if found is None or len(found[2]) > _LONGEST:
        return None
    unit = found[2].strip("[]() ")
    return (found[1].strip(), unit) if is_unit(unit) else None


def _in_unit(number: str, unit: str, wanted: str) -> str:
    """Return a number in the unit `wanted`, blank where it cannot be."""
    if unit == wanted:
        return number
    comma = "," in number
    try:
        made = conversion(unit, wanted, "")
        value = float(number.replace(",", ".")) * made.factor + made.offset
    except (IdentifyError, ValueError):
        return ""
    return f"{value:.15g}".replace(".", ",") if comma else f"{value:.15g}"


def _cells(line: str, mark: str) -> list[str]:
    if mark == " ":
        return _APART.sub("", line).split()
    return bare_cells(line, mark)


def _quoted(cell: str, mark: str) -> str:
    return f'"{cell}"' if mark in cell and mark != " " else cell
