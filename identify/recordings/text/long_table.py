"""Read a table of one value a line, beside the name of what it is of: time, name, value.

So write databases and home automation. What has times of its own is held on those of the quickest, see `groups.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np

from firmloop.identify.printed_units import conversion, is_unit
from firmloop.identify.recordings.columns import called_a_time
from firmloop.identify.recordings.groups import Group, table_of_groups
from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.recordings.text.calendar_stamps import with_seconds
from firmloop.identify.recordings.text.cells import bare_cells, is_number
from firmloop.identify.recordings.text.lines import Lines
from firmloop.identify.recordings.text.states import value_of
from firmloop.identify.recordings.ticks import tick_of
from firmloop.identify.units import likely_unit

_NAMES = frozenset(
    "name signal variable entity_id entity sensor topic tag channel metric field _field parameter series id key "
    "quantity point item label kanal bezeichnung".split()
)
_VALUES = frozenset("value _value state reading val payload wert messwert valeur valor valore".split())
_UNITS = frozenset("unit units uom einheit unit_of_measurement".split())
_CHANGED = frozenset("last_changed last_updated created_at received_at".split())
_NOTHING = frozenset(("", "unavailable", "unknown", "none", "null", "nan"))  # for a value that is missing
_HIGHEST, _MOST, _FEWEST = 20, 200, 3  # lines above the header; names; values that make a column


def read_long(lines: Lines) -> RawTable | Misread | None:
    """Return a column for each name, None for another kind of table."""
    found = next((each for k, line in enumerate(islice(lines, _HIGHEST)) if (each := _header(k, line))), None)
    if found is None:
        return None
    first, mark, head, places = found
    cut = (row for line in islice(lines, first + 1, None) if len(row := bare_cells(line, mark)) == len(head))
    picked = [[row[k] for k in places] for row in cut if row != head]
    if len(picked) < 2 * _FEWEST or len({row[1] for row in picked}) > _MOST:
        return None
    stamps, told, _ = with_seconds(Lines.of(row[0] for row in picked))
    seen: dict[str, list[tuple[float, str, str]]] = {}
    for stamp, (_, name, value, *units) in zip(stamps, picked, strict=True):
        if name and is_number(stamp) and value.lower() not in _NOTHING:
            seen.setdefault(name, []).append((float(stamp), value, units[0] if units else ""))
    clock = np.sort([stamp for rows in seen.values() for stamp, *_ in rows])
    if len(clock) < 2 * _FEWEST:
        return None
    unit = "s" if told else likely_unit(head[places[0]], "s") or tick_of(clock, head[places[0]])
    second = conversion(unit, "s", head[places[0]]).factor
    groups = [group for name, rows in seen.items() if (group := _group(name, rows, second)) is not None]
    if len(groups) < 2:
        return None
    table = table_of_groups(groups, "save each name as a column of its own")
    if isinstance(table, Misread):
        return table
    aside = {name: f"holds {rows[-1][1][:20]!r}" for name, rows in seen.items() if name not in table.names}
    notes = (
        f"has one value a line, whose names in {head[places[1]]} are its columns",
        *table.notes,
        *filter(None, (told,)),
    )
    return RawTable(table.names, table.columns, table.place, table.places, table.units, notes, aside)


def _header(place: int, line: str) -> tuple[int, str, list[str], list[int]] | None:
    """Return the index of a header, the mark between its cells, these, and where time, name, value and unit stand."""
    for mark in "\t;|,":
        head = bare_cells(line, mark)
        words = [cell.lower() for cell in head]
        times = [k for k, word in enumerate(words) if called_a_time(word)] or _of(words, _CHANGED)
        names, values = _of(words, _NAMES), _of(words, _VALUES)
        if times and names and values:
            return place, mark, head, [times[0], names[-1], values[-1], *_of(words, _UNITS)[:1]]
    return None


def _of(words: Sequence[str], wanted: frozenset[str]) -> list[int]:
    return [k for k, word in enumerate(words) if word in wanted]


def _group(name: str, rows: list[tuple[float, str, str]], second: float) -> Group | None:
    """Return what has one name in order of time, of several values at one time the last; None of words alone."""
    states = value_of({value.lower() for _, value, _ in rows})
    last = {
        stamp: states[value.lower()] if states else float(value)
        for stamp, value, _ in sorted(rows, key=lambda row: row[0])
        if states or is_number(value)
    }
    if len(last) < _FEWEST:
        return None
    unit = rows[-1][2] if is_unit(rows[-1][2]) else ""
    values = np.array(list(last.values()), dtype=np.float64)
    return Group(name, (("time_s", second * np.array(list(last)), "s"), (name, values, unit)))
