"""A Recording: what a bench measured, checked row by row before anyone may use it."""

from __future__ import annotations

import gzip
import hashlib
import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.formats import find_format, known_endings
from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

Array = NDArray[np.float64]

FEWEST_ROWS = 3  # one step and one row to judge it by


@dataclass(frozen=True, slots=True)
class Recording:
    """Signals over time; the input of row k acts from `time[k]`, an output of row k is read just before that.

    `time` is (n,) in s, strictly rising and not necessarily even; every column is (n,) in its signal's unit, and the
    range of a signal is what was measured. `source` names the file, `sha256` its bytes.
    """

    time: Array
    columns: Mapping[str, Array]
    signals: tuple[Signal, ...]
    source: str
    sha256: str
    hold: str = "zero_order"  # what an input does between rows, see identify.hold

    def part(self, first: int, end: int) -> Recording:
        """Return the rows from `first` to before `end`, at the times they had."""
        columns = {name: np.ascontiguousarray(values[first:end]) for name, values in self.columns.items()}
        return replace(self, time=np.ascontiguousarray(self.time[first:end]), columns=MappingProxyType(columns))


def read_recording(path: Path, rename: Mapping[str, str], hold: str = "zero_order") -> Recording:
    """Read CSV (plain or gzip), npz, MATLAB or Parquet; `rename` maps a foreign column name to ours.

    Raises IdentifyError naming file, row, column and what to do.
    """
    form = find_format(path.name)
    if form is None:
        raise IdentifyError(f"{path}: the ending is unknown; a recording ends in {', '.join(known_endings())}")
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise IdentifyError(f"{path}: there is no such file; paths are relative to the project file") from None
    except OSError as error:
        raise IdentifyError(f"{path}: cannot be read ({error.strerror}); give a readable file") from None
    if not content:
        raise IdentifyError(f"{path}: is empty; write one header line (time_s, then the signals) and the samples")
    table = form.read(content)
    if isinstance(table, Misread):
        where = f"{table.where}: " if table.where else ""
        raise IdentifyError(f"{path}: {where}{table.wrong}; {table.remedy}")
    names = tuple(rename.get(name, name) for name in table.names)
    _check_names(path, table.names, names)
    _check_rows(path, names, table)
    columns = dict(zip(names, table.columns, strict=True))
    made = make_recording(columns.pop("time_s"), columns, path.name, hashlib.sha256(content).hexdigest())
    return replace(made, hold=hold)


def make_recording(time: Array, columns: Mapping[str, Array], source: str, sha256: str) -> Recording:
    """Wrap arrays that are known to be sound; the units are read from the names."""
    frozen = {name: _read_only(column) for name, column in columns.items()}
    signals = tuple(Signal(n, unit_of(n), float(column.min()), float(column.max())) for n, column in frozen.items())
    return Recording(_read_only(time), MappingProxyType(frozen), signals, source, sha256)


def column(recording: Recording, name: str) -> Array:
    """Return one column, or raise IdentifyError that lists the columns there are."""
    if name not in recording.columns:
        raise IdentifyError(
            f"{recording.source}: column {name} is missing; it has {', '.join(recording.columns) or 'only time_s'} "
            f"(map a foreign name in [recordings.rename])"
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


def _check_names(path: Path, foreign: tuple[str, ...], names: tuple[str, ...]) -> None:
    for position, name in enumerate(names):
        if not name:
            raise IdentifyError(f"{path}: column {position + 1} has no name; name every column in the header")
        if name in names[:position]:
            origin = f" ({foreign[position]} was renamed)" if foreign[position] != name else ""
            raise IdentifyError(f"{path}: column {name} stands twice{origin}; rename or delete one of them")
    if "time_s" not in names:
        raise IdentifyError(
            f"{path}: column time_s is missing; it has {', '.join(names)[:200]} "
            f"(name the time column time_s, or map it in [recordings.rename])"
        )


def _check_rows(path: Path, names: tuple[str, ...], table: RawTable) -> None:
    rows = len(table.places)
    if rows < FEWEST_ROWS:
        raise IdentifyError(f"{path}: has {rows} rows; at least {FEWEST_ROWS} are needed to see anything move")
    for name, values in zip(names, table.columns, strict=True):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            where = f"{table.place} {table.places[bad[0]]}, column {name}"
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            raise IdentifyError(f"{path}: {where}: is {values[bad[0]]}{more}; delete those rows or fill them in")
    time = table.columns[names.index("time_s")]
    falls = np.flatnonzero(np.diff(time) <= 0.0)
    if len(falls):
        k = int(falls[0])
        where = f"{table.place} {table.places[k + 1]}, column time_s"
        raise IdentifyError(
            f"{path}: {where}: {float(time[k + 1])!r} does not come after {float(time[k])!r} of the row before; "
            f"time must rise, so delete the repeated rows or sort them"
        )
