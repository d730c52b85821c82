"""A Recording: what a bench measured, checked row by row before anyone may use it."""

from __future__ import annotations

import gzip
import hashlib
import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.columns import Column, RowClock, arranged, in_another_unit
from firmloop.identify.recordings.extent import check_columns, read_whole
from firmloop.identify.recordings.formats import find_format, known_endings
from firmloop.identify.recordings.lost_rows import leapt_over, uncounted
from firmloop.identify.recordings.stamps import check_stamps, check_wraps
from firmloop.identify.recordings.table import Misread, RawTable, told_aside, told_words, without_row_numbers
from firmloop.identify.recordings.ticks import check_tick
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

Array = NDArray[np.float64]

FEWEST_ROWS = 3  # one step and one row to judge it by
MOST = 1e30  # of a reading; instruments write 9.9E+37 or 9.91E+37 where they have none, as SCPI asks for
LEAST = 1e-30  # of a column's largest number, unless all are 0: squares of smaller ones vanish


@dataclass(frozen=True, slots=True)
class Recording:
    """Signals over time; the input of row k acts from `time[k]`, an output of row k is read just before that.

    `time` is (n,) in s, strictly rising and not necessarily even; every column is (n,) in its signal's unit, and the
    range of a signal is what was measured. `source` names the file, `sha256` its bytes. `words` says what its columns
    without numbers hold.
    """

    time: Array
    columns: Mapping[str, Array]
    signals: tuple[Signal, ...]
    source: str
    sha256: str
    hold: str = "zero_order"  # what an input does between rows, see identify.hold
    notes: tuple[str, ...] = ()  # how the file was read, where it is not plain
    words: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    from_rest: bool = False  # its first row is taken to be at rest, see `begun_at_rest`

    def part(self, first: int, end: int) -> Recording:
        """Return the rows from `first` to before `end`, at the times they had."""
        columns = {name: np.ascontiguousarray(values[first:end]) for name, values in self.columns.items()}
        time, from_rest = np.ascontiguousarray(self.time[first:end]), self.from_rest and not first
        return replace(self, time=time, columns=MappingProxyType(columns), from_rest=from_rest)


def read_recording(
    path: Path, rename: Mapping[str, Column], hold: str = "zero_order", clock: RowClock | None = None
) -> Recording:
    """Read a file of any format; `rename` says what a foreign column is, `clock` stands for its time column.

    Raises IdentifyError naming file, row, column and what to do.
    """
    return recording_of(path, *read_raw(path), rename, hold, clock)


def recording_of(
    path: Path,
    raw: RawTable,
    digest: str,
    rename: Mapping[str, Column],
    hold: str = "zero_order",
    clock: RowClock | None = None,
) -> Recording:
    """Make a recording of what `read_raw` has found in a file; else as `read_recording`."""
    raw = raw.with_states(raw.states)
    table = arranged(raw, rename, clock, str(path))
    _check_rows(path, table)
    given = {rename.get(name, Column(name)).name: (name, rename.get(name, Column(name))) for name in raw.names}
    timed = given.get("time_s", ("time_s", Column("time_s")))
    if clock is None:
        place = raw.names.index(timed[0])
        check_tick(raw.columns[place], raw.units[place] if raw.units else "", timed, str(path))
        check_wraps(raw.columns[place], table, timed, str(path))
    check_stamps(table, timed, str(path))
    columns = dict(zip(table.names, table.columns, strict=True))
    made = make_recording(columns.pop("time_s"), columns, path.name, digest)
    lost = (*leapt_over(made.time), *uncounted(made.time, made.columns))
    notes = (*(f"{path.name} {note}" for note in table.notes), *(f"{path.name}: {note}" for note in lost))
    return replace(made, hold=hold, notes=notes, words=MappingProxyType(dict(table.words)))


def read_raw(path: Path) -> tuple[RawTable, str]:
    """Return the columns of a file under their own names, and the SHA-256 of its bytes.

    Raises
    ------
    IdentifyError
        when there is no table in it.
    """
    form = find_format(path.name)
    if form is None:
        raise IdentifyError(f"{path}: the ending is unknown; a recording ends in {', '.join(known_endings())}")
    content = read_whole(path)
    if not content:
        raise IdentifyError(f"{path}: is empty; write one header line (time_s, then the signals) and the samples")
    raw = form.read(content)
    if isinstance(raw, RawTable):
        raw = without_row_numbers(raw)
        raw = check_columns(len(raw.names)) or raw
    if isinstance(raw, Misread):
        where = f"{raw.where}: " if raw.where else ""
        raise IdentifyError(f"{path}: {where}{raw.wrong}; {raw.remedy}")
    return raw, hashlib.sha256(content).hexdigest()


def make_recording(time: Array, columns: Mapping[str, Array], source: str, sha256: str) -> Recording:
    """Wrap arrays that are known to be sound; the units are read from the names."""
    frozen = {name: _read_only(column) for name, column in columns.items()}
    signals = tuple(Signal(n, unit_of(n), float(column.min()), float(column.max())) for n, column in frozen.items())
    return Recording(_read_only(time), MappingProxyType(frozen), signals, source, sha256)


def column(recording: Recording, name: str, otherwise: str = "") -> Array:
    """Return one column, or raise IdentifyError that lists those there are, with the line for one in another unit.

    `otherwise` is what else there is to do than to map a foreign name.
    """
    if name not in recording.columns:
        if holds := recording.words.get(name):
            raise IdentifyError(f"{recording.source}: {told_aside(name, holds)}")
        lines = [line for foreign in recording.columns if (line := in_another_unit(foreign, name))]
        aside = told_words(recording.words)
        raise IdentifyError(
            f"{recording.source}: column {name} is missing; it has {', '.join(recording.columns) or 'only time_s'} "
            f"(map a foreign name in [recordings.rename]{otherwise}){aside}",
            f"[recordings.rename]\n{lines[0]}" if lines else "",
        )
    return recording.columns[name]


def write_recording(recording: Recording, path: Path) -> None:
    """Write CSV (packed where `path` ends in .gz) whose numbers read back bit for bit; whole or not at all."""
    values = np.column_stack([recording.time, *recording.columns.values()]).tolist()
    lines = [",".join(("time_s", *recording.columns)), *(",".join(map(repr, row)) for row in values), ""]
    content = "\n".join(lines).encode()
    if path.name.endswith(".gz"):
        content = gzip.compress(content, mtime=0)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        with temporary.open("xb") as stream:  # unlike mkstemp, open follows the user's umask
            stream.write(content)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _read_only(values: Array) -> Array:
    fixed = np.array(values, dtype=np.float64)
    fixed.flags.writeable = False
    return fixed


def _check_rows(path: Path, table: RawTable) -> None:
    rows = len(table.places)
    if rows < FEWEST_ROWS:
        raise IdentifyError(f"{path}: has {rows} rows; at least {FEWEST_ROWS} are needed to see anything move")
    for name, values in zip(table.names, table.columns, strict=True):
        bad = np.flatnonzero(~(np.abs(values) <= MOST))
        if len(bad):
            where = f"{table.place} {table.places[bad[0]]}, column {name}"
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            few = 2 * len(bad) < rows
            remedy = "delete those rows or fill them in" if few else "fill it in, or leave the column out of the file"
            says = "" if np.isnan(values[bad[0]]) else ", which stands for an overload or a missing reading"
            raise IdentifyError(f"{path}: {where}: is {values[bad[0]]}{says}{more}; {remedy}")
        largest = float(np.max(np.abs(values)))
        if 0.0 < largest < LEAST:
            raise IdentifyError(
                f"{path}: column {name}: holds nothing larger than {largest:.3g}; a quantity is 0 or from {LEAST:g} to "
                f"{MOST:g}: check its exponent and its unit, or leave the column out of the file"
            )
