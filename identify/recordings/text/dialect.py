"""Recognize how a text file writes its columns: delimiter, decimal mark, header, units, what stands around them.

A file is read in one way or not at all: where two ways fit, that is said. Data are the first three or more lines of
numbers in a row; the header is the nearest line above with a name for each.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, pairwise, product

from firmloop.identify.printed_units import is_unit
from firmloop.identify.recordings.columns import called_a_counter, called_a_time
from firmloop.identify.recordings.table import Misread
from firmloop.identify.recordings.text.cells import bare, grouped, is_number, quoted_cells
from firmloop.identify.recordings.text.words import ASIDE
from firmloop.identify.units import carried_unit

_MARKS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
_PARTING = ";\t|,"
_WAYS = ((",", "."), (",", ","), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", "."), ("|", ","))
_SPACED = ((" ", "."), (" ", ","))  # any number of them is one
_FEWEST, _MOST = 3, 200  # rows that make a table, and that are looked at for how it is written
_A_NUMBER = re.compile(r"\d|nan|inf", re.IGNORECASE)  # every row of numbers has one of these
_FIRST = 10_000  # lines that are looked at first: hardly a file has a longer preamble
_LAST = 200_000  # lines that are looked at, in every way: seconds
_HIGHEST = 60  # lines between a header and its rows
_NO_UNIT, _ONE = ("", "-", "none", "#"), "1"


@dataclass(frozen=True, slots=True)
class Dialect:
    """How columns are written; `first` is the index of the first row, `trailing` how many empty cells end each row."""

    delimiter: str
    decimal: str
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    first: int = 0
    trailing: int = 0
    quoted: bool = False
    notes: tuple[str, ...] = ()

    def plain_rows(self, rows: Iterable[str]) -> Iterable[str]:
        """Yield rows with points in their numbers, without quotes and without empty cells at their ends."""
        if self.delimiter == " ":
            rows = (" ".join(row.split()) for row in rows)
        if self.quoted:
            rows = (self.delimiter.join(_numbers(row, self)) for row in rows)
        elif self.decimal == ",":
            rows = (row.replace(",", ".") for row in rows)
        end = self.delimiter * self.trailing
        return (row.rstrip(" ").removesuffix(end) for row in rows) if end else rows


PLAIN = Dialect(",", ".")


def parting_mark(header: str, row: str) -> str:
    """Return what parts the header and a row into as many columns, more than one; blank where nothing does."""
    return next((mark for mark in _PARTING if 0 < header.count(mark) == row.count(mark)), "")


def find_dialect(lines: Sequence[str]) -> Dialect | Misread | None:
    """Return how the columns of `lines` are written, what is wrong with them, or None where nothing is recognized."""
    tries = product((lines[:_FIRST], lines if len(lines) > _FIRST else ()), (_WAYS, _SPACED))
    tables = ([each for way in ways if (each := _table(part, *way)) is not None] for part, ways in tries)
    found = next(filter(None, tables), None)
    if found is None:
        return None
    widest = max(found, key=lambda each: len(cells_of(lines[each.first], each)))
    dialect = _with_header(lines, widest)
    if not isinstance(dialect, Dialect) or dialect.decimal == ".":
        return dialect
    for mark in ",.":
        held = (row for row in islice(lines, dialect.first, None) if mark in row)
        cells = (cell.strip() for row in held for cell in cells_of(row, dialect) if mark in cell)
        example = next(cells, "")
        if example and all(map(re.compile(f"{grouped(re.escape(mark))}+").fullmatch, chain((example,), cells))):
            remedy = "save the file with points in its numbers and no marks for thousands"
            return Misread("", f"can be read in two ways: {example} may be a fraction or thousands", remedy)
    return dialect


def _table(lines: Sequence[str], delimiter: str, decimal: str) -> Dialect | None:
    """Return where rows of at least two numbers begin, None where there are none."""
    run, width, first, quoted = 0, 0, 0, False
    plain = Dialect(delimiter, decimal)
    ways = plain, replace(plain, quoted=True)
    for k, line in enumerate(islice(lines, _LAST)):
        if _A_NUMBER.search(line) is None:
            run = 0 if line.strip() else run
            continue
        if run == 0 or ('"' in line) != quoted:
            run, first, quoted = 0, k, '"' in line
        row = ways[quoted]
        cells = _numbers(line, row) if delimiter != decimal or quoted else []
        filled = _filled(cells)
        if filled < 2 or not all(map(is_number, cells[:filled])):
            run = 0
            continue
        if run and (len(cells) != width):
            run, first = 0, k
        run, width = run + 1, len(cells)
        if run == _FEWEST:
            ends = [len(each) - _filled(each) for each in _some_rows(lines, first, row)]
            return Dialect(delimiter, decimal, first=first, trailing=min(ends), quoted=quoted)
    return None


def _some_rows(lines: Sequence[str], first: int, dialect: Dialect) -> list[list[str]]:
    rows = (line for line in islice(lines, first, None) if line.strip())
    return [cells_of(line, dialect) for line in islice(rows, _MOST)]


def _header_to_write(lines: Sequence[str], table: Dialect, width: int) -> str:
    """Say which names a table without a header may have; a first column that does not rise is no time."""
    read = [_numbers(line, table)[0].strip() for line in lines[table.first : table.first + _MOST] if line.strip()]
    first = [float(each) for each in read if is_number(each)]
    rises = len(first) > 1 and all(one < other for one, other in pairwise(first))
    columns = ", ".join(("time_s" if rises else "column_1", *(f"column_{k}" for k in range(2, width + 1)))[:6])
    untimed = "; without a column of times, give the time between two rows: --period of init, or recordings.period_s"
    return f"write one line above, such as {columns}{'' if rises else untimed}"


def _with_header(lines: Sequence[str], table: Dialect) -> Dialect | Misread | None:
    """Find the names, and the units where a line of them stands below."""
    width = len(cells_of(lines[table.first], table)) - table.trailing
    said = (k for k in range(table.first - 1, max(-1, table.first - _HIGHEST), -1) if lines[k].strip())
    above = [k for k in said if any(map(str.isalnum, lines[k]))]  # a rule of dashes says nothing
    later = range(table.first, min(len(lines), table.first + _HIGHEST))
    late = next((k + 1 for k in later if _names(lines[k], table, width)), 0)
    if not above and late:
        remedy = f"they are of an older run: delete lines 1 to {late - 1}, or split the file"
        return Misread(f"line {late}", "is the header, but rows stand above it", remedy)
    if not above:
        return Misread("", "has no header: its first line holds numbers", _header_to_write(lines, table, width))
    headers = {k: names for k in above if (names := _names(lines[k], table, width))}
    if above[:2] and headers and next(iter(headers)) == above[0] and _all_units(headers[above[0]]):
        numbered = _numbered(lines[above[1]], table, width) if len(above) > 1 else ()
        headers = {above[0]: headers[above[0]], above[1]: numbered} if numbered else headers
    if not headers:
        nearest = cells_of(lines[above[0]], table)
        if all(is_number(cell.strip()) for cell in nearest):
            wrong = f"has no header: line {above[0] + 1}, above its rows, is a row that is not whole"
            return Misread("", wrong, f"write a name for each of the {width} columns there, time_s among them")
        if len(nearest) * 2 == width and table.delimiter == ",":
            wrong = "has twice as many numbers in a row as names: decimal commas between commas"
            return Misread(f"line {table.first + 1}", wrong, "export it with ; or tabs between columns")
        return _otherwise_parted(lines[above[0]], above[0] + 1, table, width) or _unnamed(lines, above[0], table, width)
    below, *higher = headers
    units: tuple[str, ...] = ()
    if higher and higher[0] == above[above.index(below) + 1]:
        units = _units_below(headers[higher[0]], headers[below], cells_of(lines[table.first], table))
        below, *higher = higher if units else (below, *higher)
    if not units and not _tells(headers[below]):
        below = next((k for k in higher if _tells(headers[k])), below)
    start = below + 1 if not units else above[above.index(below) - 1] + 1
    said = (k for k in range(start, table.first) if any(map(str.isalnum, lines[k])))
    whole = (k for k in said if len(cells_of(lines[k], table)) == width + table.trailing)
    return Dialect(
        table.delimiter,
        table.decimal,
        headers[below],
        units,
        next(whole, table.first),  # a line with a value for each column is a row, though it may not be numbers
        table.trailing,
        table.quoted,
        tuple(_told(lines, table, below, units)),
    )


def _otherwise_parted(line: str, number: int, table: Dialect, width: int) -> Misread | None:
    """Say that the header has another mark between its names than the rows have between their values, if it has."""
    others = (replace(table, delimiter=mark) for mark in _MARKS if mark != table.delimiter)
    header = next((each for each in others if len(cells_of(line, each)) == width and _names(line, each, width)), None)
    if header is None:
        return None
    wrong = (
        f"is the header and has {_MARKS[header.delimiter]} between its names, where rows have {_MARKS[table.delimiter]}"
    )
    names = table.delimiter.join(_names(line, header, width))
    return Misread(f"line {number}", wrong, f"write the same between names: {names[:200]}; keep the rows")


def _unnamed(lines: Sequence[str], above: int, table: Dialect, width: int) -> Misread | None:
    """Say that there is no header where the line above the rows has nothing that parts columns."""
    if len(cells_of(lines[above], table)) > 1:
        return None
    wrong = f"has no header: line {above + 1}, above its rows, names no columns: {lines[above].strip()[:40]!r}"
    return Misread("", wrong, _header_to_write(lines, table, width))


def _told(lines: Sequence[str], table: Dialect, header: int, units: tuple[str, ...]) -> list[str]:
    """Say in what this file is not plain."""
    marks = f"{_MARKS[table.delimiter]} between columns" if table.delimiter != "," else ""
    decimal = "decimal commas" if table.decimal == "," else ""
    told = " and ".join(filter(None, (marks, decimal)))
    aside = [k for k in range(table.first) if lines[k].strip() and k != header]
    aside = aside[:-1] if units else aside
    said = [f"has {told}"] if told else []
    if units:
        said.append(f"has a line of units below its header, which is taken: {', '.join(filter(None, units))}")
    if aside:
        count = "1 line is" if len(aside) == 1 else f"{len(aside)} lines are"
        said.append(f"{count} left aside, the header is line {header + 1}: {lines[aside[0]].strip()[:40]!r}")
    if table.trailing:
        said.append(f"every line ends with {'a delimiter' if table.trailing == 1 else 'delimiters'}; no column is lost")
    return said


def _names(line: str, table: Dialect, width: int) -> tuple[str, ...]:
    """Return the names of a line that has one for each column, else nothing."""
    cells = [bare(cell) for cell in cells_of(first_name(line), table)]
    if len(cells) == width + 1 and cells[-1].lower() == "comment":  # LabVIEW leaves this column empty
        cells = cells[:-1]
    numbers = {cell for cell in cells if is_number(cell.replace(",", "."))}
    names = cells[:width]
    if (
        any(cells[width:])
        or len(cells) < width
        or not (numbers <= {_ONE} and (not numbers or _all_units(tuple(names))))
    ):
        return ()
    return tuple(names) if sum(map(bool, names)) >= max(1, width - 1) else ()


def _numbered(line: str, table: Dialect, width: int) -> tuple[str, ...]:
    """Return the names of a line that counts channels, as x-axis,1,2,MATH does, else nothing."""
    cells = [cell.strip() for cell in cells_of(line, table)][:width]
    named = all(each.isdecimal() or (each and not is_number(each)) for each in cells[1:])
    counts = len(cells) == width and not is_number(cells[0]) and named and any(map(str.isdecimal, cells[1:]))
    return tuple(cells) if counts and cells[0] else ()


def first_name(line: str) -> str:
    """Return a header without the sign of a comment that some write before it."""
    return re.sub(r"^\s*(?:#|%|//)\s*(?=[^\s,;|])", "", line)


def _tells(names: tuple[str, ...]) -> bool:
    return any(name == "time_s" or carried_unit(name) for name in names)


def _all_units(names: tuple[str, ...]) -> bool:
    bare = [_bare(name) for name in names]
    said = [unit for unit in bare if unit not in _NO_UNIT]
    return any(unit != _ONE for unit in said) and all(map(is_unit, said))


def _units_below(names: tuple[str, ...], line: tuple[str, ...], row: list[str]) -> tuple[str, ...]:
    """Return the units that a line below the names has, nothing where it has none.

    It may say again which columns count the rows and tell the time, and has words where a row has them.
    """
    again = [
        cell == ASIDE
        or (called_a_counter(name) and called_a_counter(said))
        or (called_a_time(name) and called_a_time(said))
        for name, said, cell in zip(names, line, row, strict=False)
    ]
    units = tuple("" if twice else _bare(said) for twice, said in zip(again, line, strict=True))
    return tuple("" if unit in _NO_UNIT else unit for unit in units) if _all_units(units) else ()


def _bare(unit: str) -> str:
    return unit.strip().strip("[]()-").strip()


def cells_of(line: str, dialect: Dialect) -> list[str]:
    """Split a line of a file as its dialect parts columns; numbers stay as they are written."""
    return quoted_cells(line, dialect.delimiter) if '"' in line else _split(line, dialect)


def _split(line: str, dialect: Dialect) -> list[str]:
    return line.split() if dialect.delimiter == " " else line.split(dialect.delimiter)


def _numbers(line: str, dialect: Dialect) -> list[str]:
    cells = cells_of(line, dialect) if dialect.quoted or '"' not in line else _split(line, dialect)
    return [cell.replace(",", ".") for cell in cells] if dialect.decimal == "," else cells


def _filled(cells: list[str]) -> int:
    return next((k for k in range(len(cells), 0, -1) if cells[k - 1].strip()), 0)
