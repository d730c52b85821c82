"""Read columns of text, fast while they are plain; other dialects are recognized only where that fails."""

from __future__ import annotations

import codecs
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.columns import tells_time
from firmloop.identify.recordings.extent import text_extent, unzipped
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.table import Misread, RawTable, to_numbers
from firmloop.identify.recordings.text.calendar_stamps import (
    first_row_first,
    with_seconds,
    with_terminal_stamps,
    without_terminal_stamps,
)
from firmloop.identify.recordings.text.cells import bare, double_quoted, grouped, is_number, with_e
from firmloop.identify.recordings.text.chatter import listed_lines, without_chatter
from firmloop.identify.recordings.text.dialect import PLAIN, Dialect, cells_of, find_dialect, first_name, parting_mark
from firmloop.identify.recordings.text.exports import read_export
from firmloop.identify.recordings.text.fractions import with_fractions
from firmloop.identify.recordings.text.frames import without_frames
from firmloop.identify.recordings.text.json_objects import MOST_DOCUMENT, begins_json, rows_of_json
from firmloop.identify.recordings.text.lines import Lines
from firmloop.identify.recordings.text.log_prefix import without_log_prefix
from firmloop.identify.recordings.text.long_table import read_long
from firmloop.identify.recordings.text.named_values import read_named_values
from firmloop.identify.recordings.text.readings import without_reading_units
from firmloop.identify.recordings.text.settings import read_settings
from firmloop.identify.recordings.text.sparse import read_sparse
from firmloop.identify.recordings.text.states import with_states
from firmloop.identify.recordings.text.teleplot import read_teleplot
from firmloop.identify.recordings.text.thousands import without_thousands
from firmloop.identify.recordings.text.turned import turned
from firmloop.identify.recordings.text.words import without_words

_CLOCK = re.compile(r"\d:\d\d")  # of a time of day
_MARKED = re.compile(r"[-+]?\d{1,3}(?:[.,]\d{3})+[.,]\d*")  # 1,127,67
_THOUSAND = re.compile(rf"(?<![\d.]){grouped(',')}(?!\d)")
_HEXADECIMAL = re.compile(r"(?:0[xX])?[0-9a-fA-F]+")
_SAMPLE = 200  # rows that say what a column holds
_STARTING = 60  # lines of noise that a board may send before it speaks
_MINUS, _INFINITE = "\u2212", "\u221e"  # of typesetters; of PicoScope, for a voltage beyond its range
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


# What is no text says so by its first bytes, whatever the file is called.
_ZIP, _UNPACK = "is a zip archive, as a workbook is", "export its sheet as CSV, or unpack the file in it"
_PACKED = {
    b"PK\x03\x04": (_ZIP, _UNPACK),
    b"\xd0\xcf\x11\xe0": ("is a workbook of Excel", "export its sheet as CSV"),
    b"BZh": ("is packed by bzip2", "unpack it, or pack it with gzip"),
    b"\xfd7zXZ": ("is packed by xz", "unpack it, or pack it with gzip"),
    b"\x89HDF": ("is an HDF5 file", "call it .h5"),
    b"PAR1": ("is a Parquet file", "call it .parquet"),
}


def read_csv(content: bytes) -> RawTable | Misread:
    """Parse a header line and rows of numbers, packed by gzip or not.

    Blank lines are skipped, line numbers count them.
    """
    if content.startswith(b"\x1f\x8b"):
        try:
            text = unzipped(content)
        except (EOFError, zlib.error) as error:
            return Misread("", f"is not a complete gzip file ({error})", "pack it again, or give the plain text")
        return text if isinstance(text, Misread) else _read_text(text)
    return _read_text(content)


def _read_text(content: bytes) -> RawTable | Misread:
    for mark, told in _PACKED.items():
        if content.startswith(mark):
            return Misread("", *told)
    if b"\n" not in content:
        content = content.replace(b"\r", b"\n")  # a line's end on old Macs and some terminals
    of_one_line = content.lstrip()[:1] in (b"[", b"{") and len(content) <= MOST_DOCUMENT
    if (wrong := text_extent(content)) and not of_one_line:
        return wrong
    text, encoding = _decoded(content)
    if isinstance(text, Misread):
        return text
    text = text.lstrip("\ufeff").replace(_MINUS, "-").replace(_INFINITE, "inf")
    text, stamps = without_terminal_stamps(text)
    text, logged = without_log_prefix(text)
    encoding += logged
    lines = Lines(text)
    if (around := turned(lines)) is not None:
        lines, encoding = around[0], (*encoding, around[1])
    begin = begins_json(lines)
    found = _read_columns(lines, encoding) if begin is None else _from_json(text, begin, encoding)
    if stamps and isinstance(found, Misread):
        return replace(found, remedy=found.remedy.partition("; without a column of times")[0])
    if not stamps or isinstance(found, Misread):
        return found
    return with_terminal_stamps(found, stamps, any(map(tells_time, found.names)))


def _from_json(text: str, begin: int, notes: tuple[str, ...]) -> RawTable | Misread:
    """Read objects of JSON as rows, and count lines without the header that they do not have."""
    rows = rows_of_json(text, begin)
    if isinstance(rows, Misread):
        return rows
    before = f"its first {begin} line{'s are' if begin > 1 else ' is'} left aside"
    said = ("holds an object of JSON in each line" if rows.place == "line" else "holds its samples in one JSON text",)
    found = _read_columns(Lines.of(rows.lines), (*notes, *said, *((before,) if begin else ())))
    if isinstance(found, Misread):
        where = re.sub(r"line (\d+)", lambda number: f"{rows.place} {int(number[1]) - 1 + begin}", found.where)
        return replace(found, where=where)
    return replace(found, place=rows.place, places=found.places - 1 + begin)


class _Rows:
    """Rows that are made anew each time that they are gone through, so that none is kept."""

    def __init__(self, made: Callable[[], Iterable[str]]) -> None:
        self._made = made

    def __iter__(self) -> Iterator[str]:
        return iter(self._made())


def _read_columns(lines: Lines, encoding: tuple[str, ...]) -> RawTable | Misread:
    header, first = next(((k, line.strip()) for k, line in enumerate(lines, 1) if line.strip()), (0, ""))
    if not header:
        return Misread("", "is empty", "write one header line (time_s, then the signals) and one line per sample")
    names = tuple(map(bare, first_name(first).split(",")))
    rows = _Rows(lambda: filter(None, map(str.strip, islice(lines, header, None))))
    plain: RawTable | Misread | None = None
    if _begins(names, rows) and not all(map(is_number, names)):
        plain = _parsed(names, rows, _filled(lines, header), PLAIN)
        if isinstance(plain, RawTable):
            return with_fractions(replace(plain, notes=(*encoding, *plain.notes)))
    bare_lines, framed = without_frames(lines)
    found = read_teleplot(bare_lines) or read_export(bare_lines) or read_settings(bare_lines)
    found = found or read_named_values(bare_lines) or read_long(bare_lines) or read_sparse(bare_lines)
    found = found or _in_dialect(bare_lines)
    if isinstance(found, RawTable):
        return replace(found, notes=(*encoding, *framed, *found.notes))
    if found is not None:
        return found
    held, numbers = [*rows], _filled(lines, header)
    if not held:
        return Misread("", "has a header but no rows", "write one line per sample below the header")
    if len(names) == 1 and (mark := parting_mark(first, held[-1])):  # then the complaint names a column that is there
        parted = Dialect(mark, ",")
        called = tuple(map(bare, first_name(first).split(mark)))
        return _culprit(called, [*parted.plain_rows(held)], numbers, parted, "", [*map(str.strip, lines)])
    return plain or _parsed(names, held, numbers, PLAIN)


def _filled(lines: Sequence[str], first: int) -> NDArray[np.int64]:
    """Return the numbers of the lines behind the `first` that are not blank."""
    said = np.fromiter(map(bool, map(str.strip, islice(lines, first, None))), dtype=np.bool_)
    return np.flatnonzero(said) + first + 1


def _begins(names: tuple[str, ...], rows: Iterable[str]) -> bool:
    """Tell whether the first of the rows has a number for each name; without, there is no plain table."""
    first = [_even(row, names, PLAIN) for row in islice(rows, 1)]
    try:
        return any(first) and np.loadtxt(first, delimiter=",", comments=None, ndmin=2).shape[1] == len(names)
    except ValueError:
        return False


def _even(row: str, names: tuple[str, ...], dialect: Dialect) -> str:
    """Return a row without an empty cell behind the last of its values."""
    mark = dialect.delimiter
    return row[: -len(mark)] if row.endswith(mark) and row.count(mark) == len(names) else row


def _decoded(content: bytes) -> tuple[str | Misread, tuple[str, ...]]:
    """Return the text and what is told of its encoding."""
    half, most = (content[1:4000:2].count(0), content[0:4000:2].count(0)), len(content[1:4000:2])
    marked = content.startswith(_UTF_16)
    # Each digit has a byte of zero: a mark without any is noise of a line that starts.
    sixteen = max(half) > 0.05 * most if marked else max(half) > 0.4 * most > 4
    try:
        if sixteen:
            little = content.startswith(codecs.BOM_UTF16_LE) or (content[:2] not in _UTF_16 and half[0] > half[1])
            text = content.decode("utf-16-le" if little else "utf-16-be").removeprefix("\ufeff")
        else:
            text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if sixteen or marked or any(ord(sign) < 32 and sign not in "\r\n\t" for sign in text) or "\ufffd" in text:
            return _without_noise(content, error.start)
        return text, ("is not UTF-8; its signs beyond ASCII are read as Windows-1252",)
    if "\0" in text:
        return _without_noise(content, content.find(b"\0"))
    return text, ("is UTF-16 text",) if sixteen else ()


def _without_noise(content: bytes, first: int) -> tuple[str | Misread, tuple[str, ...]]:
    """Leave aside the first lines, as far as they hold what is no text: a serial port's noise while a board starts."""
    lines = content.split(b"\n")
    bad = [k for k, line in enumerate(lines) if b"\0" in line or not _is_text(line)]
    start = bad[-1] + 1
    if start > min(_STARTING, 3 * len(bad)) or not any(map(bytes.strip, lines[start:])):
        where, remedy = f"byte {first}", "save the recording as UTF-8 comma-separated text"
        if 2 * len(bad) < len(lines):
            where, remedy = f"line {bad[0] + 1}", "delete the line if the serial port has garbled it"
        return Misread(where, "is not text", remedy), ()
    told = "its first line is" if start == 1 else f"its first {start} lines are"
    return "\n" * start + b"\n".join(lines[start:]).decode(), (f"{told} left aside, for bytes that are no text",)


def _is_text(line: bytes) -> bool:
    try:
        line.decode()
    except UnicodeDecodeError:
        return False
    return True


def _in_dialect(lines: Lines) -> RawTable | Misread | None:
    """Read another dialect, None where none is recognized."""
    lines, quotes = double_quoted(lines)
    lines, exponents = with_e(lines)
    readings = without_reading_units(lines)
    if isinstance(readings, Misread):
        return readings
    lines, read_in, said = readings
    lines, stamps, stamped = with_seconds(lines)
    thousands = without_thousands(lines)
    if isinstance(thousands, Misread):
        return thousands
    lines, marks = thousands
    lines, states = with_states(lines)
    lines, words, aside = without_words(lines)
    found = find_dialect(lines)
    if found is None or isinstance(found, Misread):
        return found
    rows = _Rows(lambda: found.plain_rows(filter(str.strip, islice(lines, found.first, None))))
    table = _parsed(found.names, rows, _filled(lines, found.first), found, lines)
    if isinstance(table, Misread):
        return table
    kept = [k for k in range(len(table.names)) if k not in words and k not in states]
    printed = enumerate(found.units or ("",) * len(table.names))
    units = ["s" if k == stamped else read_in.get(k, unit) for k, unit in printed]
    left = {table.names[k]: holds for k, holds in words.items() if table.names[k]}
    aside = f"{aside} ({', '.join(left)})" if left else aside
    told = {table.names[k]: (table.columns[k], *says) for k, says in states.items() if table.names[k]}
    made = RawTable(
        tuple(table.names[k] for k in kept),
        tuple(table.columns[k] for k in kept),
        table.place,
        table.places,
        tuple(units[k] for k in kept) if any(units) else (),
        (*found.notes, *table.notes, *filter(None, (quotes, exponents, said, stamps, marks, aside))),
        left | {name: holds for name, (_, holds, _) in told.items()},
        {name: (column, says) for name, (column, _, says) in told.items()},
    )
    place = kept.index(stamped) if stamped in kept else None
    made = with_fractions(made, place)
    return first_row_first(made, place)


def _parsed(
    names: tuple[str, ...],
    rows: Iterable[str],
    numbers: NDArray[np.int64],
    dialect: Dialect,
    written: Sequence[str] = (),
) -> RawTable | Misread:
    """Return the table of plain rows; `written` are the lines of the file, by which a complaint quotes them."""
    try:
        values = np.loadtxt(rows, delimiter=dialect.delimiter, comments=None, ndmin=2)
    except ValueError as error:
        held = [*rows]
        even = [_even(row, names, dialect) for row in held]
        if even != held and not all(map(str.__ne__, even, held)):
            return _parsed(names, even, numbers, dialect, written)
        quiet = _without_chatter(names, held, numbers, dialect, written)
        return quiet or _culprit(names, held, numbers, dialect, str(error), written)
    if values.shape[1] != len(names):
        says = f"{values.shape[1]} values below {len(names)} names"
        return _culprit(names, [*rows], numbers, dialect, says, written)
    return RawTable(names, tuple(np.ascontiguousarray(column) for column in values.T), "line", numbers)


def _without_chatter(
    names: tuple[str, ...], rows: list[str], numbers: NDArray[np.int64], dialect: Dialect, written: Sequence[str]
) -> RawTable | Misread | None:
    """Parse the rows between which a board has said something; None where it has not."""
    kept, left, told = without_chatter(names, rows, numbers, dialect.delimiter)
    if not told:
        return None
    found = _parsed(names, kept, left, dialect, written)
    return replace(found, notes=(*found.notes, told)) if isinstance(found, RawTable) else found


def _culprit(
    names: tuple[str, ...],
    rows: list[str],
    numbers: NDArray[np.int64],
    dialect: Dialect,
    says: str,
    written: Sequence[str] = (),
) -> Misread:
    """Go through the rows one by one until one does not parse; only called when the fast way failed."""
    widths = [len(row.split(dialect.delimiter)) for row in rows[:_SAMPLE]]
    if digits := _split_decimals(rows[:_SAMPLE], len(names), dialect):
        wrong = f"has more numbers in a row than names, and some are digits alone, such as {digits!r}: decimal commas"
        return Misread(f"line {numbers[0]}", f"{wrong} between commas", "export it with ; or tabs between columns")
    if len(rows) > 2 and len({*widths}) == 1 and widths[0] != len(names) > 1:
        wrong = f"has {len(names)} names above {widths[0]} values in every row"
        return Misread(f"line {numbers[0] - 1}", wrong, "give the header one name for each column; keep the rows")
    for number, row in zip(numbers, rows, strict=True):
        cells = row.split(dialect.delimiter)
        if tuple(map(bare, cells)) == names:
            remedy = "split the file there, or delete the line where the clock goes on"
            return Misread(f"line {number}", "is the header again: the logger started anew", remedy)
        if len(cells) != len(names):
            wrong = f"has {len(cells)} values where the header names {len(names)} columns"
            others = [
                int(n) for n, r in zip(numbers, rows, strict=True) if n > number and _width(r, dialect) != len(names)
            ]
            if others:
                wrong += f", and {len(others)} more are not whole (line {listed_lines(others)})"
            split = len(cells) > len(names) == len(cells) - len(_THOUSAND.findall(row))
            remedy = "write numbers without a comma for thousands" if split else "complete the row or delete it"
            return Misread(f"line {number}", wrong, remedy)
        for k, (name, cell) in enumerate(zip(names, cells, strict=True)):
            if not is_number(cell.strip().strip('"')):
                shown = bare(cells_of(written[number - 1], dialect)[k]) if written else cell.strip()
                wrong = f"is {shown[:40]!r}, not a number" if cell.strip() else "is empty"
                remedy = _remedy(name, k, rows, dialect)
                if _MARKED.fullmatch(shown):
                    wrong += ": only one of its marks can be the decimal one"
                    remedy = "save the file without marks for thousands; keep the rows"
                if _CLOCK.search(cell):
                    remedy = "write seconds, or leave the column out and give recordings.period_s"
                return Misread(f"line {number}, column {name}", wrong, remedy)
            if cell.strip().startswith('"'):
                wrong, remedy = f"is {cell.strip()[:40]!r}, a number in quotes", "write numbers without quotes"
                if not cell.strip().endswith('"'):
                    wrong, remedy = (
                        f"is {cell.strip()[:40]!r}: its quote does not close",
                        "delete that quote; keep the row",
                    )
                return Misread(f"line {number}, column {name}", wrong, remedy)
    return Misread("", f"cannot be parsed: {says}", "write plain decimal numbers separated by commas")


def _split_decimals(rows: list[str], names: int, dialect: Dialect) -> str:
    """Return digits that stood behind a decimal comma where commas part columns, too; blank where none did.

    They have no sign and no point, and as many of them in every row: only so does a number begin with a zero.
    """
    cells = [row.split(dialect.delimiter) for row in rows]
    if dialect.delimiter != "," or len(rows) < 3 or any(len(each) <= names for each in cells):
        return ""
    for column in zip(*cells, strict=False):
        if len({*map(len, column)}) == 1 and all(each.isdecimal() for each in column):
            found = next((each for each in column if len(each) > 1 and each.startswith("0")), "")
            if found and any(each != found for each in column):
                return str(found)
    return ""


def _width(row: str, dialect: Dialect) -> int:
    return len(row.split(dialect.delimiter))


def _remedy(name: str, place: int, rows: list[str], dialect: Dialect) -> str:
    """Name the cure that keeps the rows: one cell is a slip, most of a column is another kind of column."""
    cells = [(*row.split(dialect.delimiter), *[""] * len(rows[0]))[place] for row in rows[:_SAMPLE]]
    wrong = sum(not is_number(cell.strip().strip('"')) for cell in cells)
    if wrong > 2 and all(_HEXADECIMAL.fullmatch(cell.strip()) for cell in cells):
        return f"{name} looks hexadecimal: write its numbers in decimal; keep the rows"
    if 2 * wrong < len(cells) or len(cells) < 2:
        return "write a number with '.' or delete the row"
    if all(dialect.delimiter not in row for row in rows[:_SAMPLE]):
        return "save the values of a line with commas between them, below a header that names each; keep the lines"
    cure = to_numbers([f"holds {cells[0].strip()!r}"], "write numbers there")
    return f"so are {wrong} of {len(cells)} rows: {cure}, or leave {name} out of the file; keep the rows"


FORMAT = Format(
    (".csv", ".tsv", ".txt", ".lvm", ".dat", ".log", ".asc", ".prn", ".jsonl", ".ndjson", ".json"), read_csv
)
