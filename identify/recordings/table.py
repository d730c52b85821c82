"""A RawTable: named columns as a file holds them, before anything is known about their meaning."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RawTable:
    """Columns of equal length. `places[k]` is where row k stands in the file, counted in `place` (line, row).

    `units` is what a line of units says of each column, empty where there is none; `notes` how the file was read, where
    that is not plain; `words` what the columns without numbers hold, which are left aside. Of those, `states` holds the
    ones of two words as 1 and 0, and which word is which.
    """

    names: tuple[str, ...]
    columns: tuple[Array, ...]
    place: str
    places: NDArray[np.int64]
    units: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    words: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    states: Mapping[str, tuple[Array, str]] = field(default_factory=lambda: MappingProxyType({}))

    def with_states(self, names: Collection[str]) -> RawTable:
        """Return the table with those of its `states` that have one of these names as columns."""
        added = {name: self.states[name] for name in self.states if name in names}
        if not added:
            return self
        return replace(
            self,
            names=(*self.names, *added),
            columns=(*self.columns, *(column for column, _ in added.values())),
            units=(*self.units, *("" for _ in added)) if self.units else (),
            notes=(*self.notes, *(f"{name} is read as {says}" for name, (_, says) in added.items())),
            words={name: holds for name, holds in self.words.items() if name not in added},
            states={name: state for name, state in self.states.items() if name not in added},
        )

    def turned_around(self) -> RawTable:
        """Return the table with its last row first."""
        return replace(
            self,
            columns=tuple(column[::-1] for column in self.columns),
            places=self.places[::-1],
            states={name: (column[::-1], says) for name, (column, says) in self.states.items()},
            notes=(*self.notes, "has its last row first, and is read from its end"),
        )


@dataclass(frozen=True, slots=True)
class Misread:
    """A file that cannot be a table: `where` (row, column or empty), what is `wrong`, and the way out (`remedy`)."""

    where: str
    wrong: str
    remedy: str


def told_words(words: Mapping[str, str]) -> str:
    """Return what to add to a message where columns are without numbers: which they are and what they hold."""
    told = ", ".join(f"{name} ({holds})" for name, holds in words.items())
    return f"; without numbers: {told[:200]}" if told else ""


_FEWEST = 2  # columns of numbers: a time and one signal
_MEASURED = re.compile(r"holds '[-+]?\d[\d.,]*\s*\D+'")  # 1168 counts


def table_of_arrays(arrays: tuple[tuple[str, NDArray[np.generic]], ...]) -> RawTable | Misread:
    """Check arrays of a binary file (one per column) and count their rows from 1.

    Dates become seconds from the first; text, columns of NaN, and single values beside arrays, are left aside, and so
    is what has another shape than most columns, such as the gains of a workspace.
    """
    columns = []
    aside = {
        name: "holds text" if array.dtype.kind in "USO" else "is one value" if array.ndim == 0 else "holds no number"
        for name, array in arrays
        if _is_a_remark(array)
    }
    aside |= _unlike([each for each in arrays if each[0] not in aside])
    if len(arrays) - len(aside) < _FEWEST:  # then what is left aside may be the signal itself
        aside = {}
    units = tuple("s" if array.dtype.kind in "mM" else "" for name, array in arrays if name not in aside)
    arrays = tuple((name, _seconds(array)) for name, array in arrays if name not in aside)
    for name, array in arrays:
        if array.ndim != 1:
            shape = "x".join(str(size) for size in array.shape) or "scalar"
            return Misread(f"column {name}", f"is a {shape} array", "store every signal as one 1-D array")
        if array.dtype.kind not in "fiub":
            return Misread(f"column {name}", f"holds {array.dtype} instead of numbers", "store it as float64")
        columns.append(np.asarray(array, dtype=np.float64))
        if len(columns[-1]) != len(columns[0]):
            wrong = f"has {len(columns[-1])} rows where {arrays[0][0]} has {len(columns[0])}"
            return Misread(f"column {name}", wrong, "store every signal with one value per row of time_s")
    rows = len(columns[0]) if columns else 0
    names = tuple(name for name, _ in arrays)
    notes = (f"holds {', '.join(aside)[:80]} beside its columns, left aside",) if aside and columns else ()
    return RawTable(names, tuple(columns), "row", np.arange(1, rows + 1), units if any(units) else (), notes, aside)


def _unlike(arrays: Sequence[tuple[str, NDArray[np.generic]]]) -> dict[str, str]:
    """Say of each array that is no column of as many rows as time_s has, or else as most have, what it is instead."""
    lengths = {name: len(array) for name, array in arrays if array.ndim == 1}
    if not lengths:
        return {}
    often = Counter(lengths.values())
    name = "time_s" if lengths.get("time_s") else max(lengths, key=lambda each: often[lengths[each]])
    rows = lengths[name]
    return {
        other: f"has {len(array)} rows where {name} has {rows}"
        if array.ndim == 1
        else f"is a {'x'.join(map(str, array.shape))} array"
        for other, array in arrays
        if array.ndim != 1 or len(array) != rows
    }


def to_numbers(words: Iterable[str], usual: str) -> str:
    """Return how what columns hold becomes numbers, `usual` but where they have numbers with a word behind each."""
    if any(map(_MEASURED.match, words)):
        return (
            "take out what stands behind its numbers, and give what it stands for as unit or scale in "
            "[recordings.rename]"
        )
    return usual


def told_aside(name: str, holds: str) -> str:
    """Return what to say where a column is needed that was left aside."""
    if holds.startswith(("has ", "is a ")):
        return f"column {name} was left aside, for it {holds}; store it as one value a row"
    return f"column {name} is no column of numbers, it {holds}; {to_numbers([holds], 'write numbers there')}"


def without_row_numbers(table: RawTable) -> RawTable:
    """Return the table without a column that has no name and counts the rows, as spreadsheets of Python write it."""
    counts = [
        k
        for k, (name, values) in enumerate(zip(table.names, table.columns, strict=True))
        if not name and len(values) > 1 and bool(np.all(np.diff(values) == 1.0))
    ]
    if len(counts) != 1:
        return table
    kept = [k for k in range(len(table.names)) if k not in counts]
    return replace(
        table,
        names=tuple(table.names[k] for k in kept),
        columns=tuple(table.columns[k] for k in kept),
        units=tuple(table.units[k] for k in kept) if table.units else (),
        notes=(*table.notes, "has a column of row numbers without a name, left aside"),
    )


def _is_a_remark(array: NDArray[np.generic]) -> bool:
    blank = array.dtype.kind == "f" and array.ndim == 1 and array.size > 0 and bool(np.all(np.isnan(array)))
    return array.ndim == 0 or array.dtype.kind in "USO" or blank


def _seconds(array: NDArray[np.generic]) -> NDArray[np.generic]:
    if array.dtype.kind not in "mM" or not len(array):
        return array
    if np.datetime_data(array.dtype.str)[0] in ("Y", "M", "generic"):  # of uneven length, or of none
        array = array.astype(f"{array.dtype.kind}8[s]")
    return np.asarray((array - array[0]) / np.timedelta64(1, "ns"), dtype=np.float64) * 1e-9
