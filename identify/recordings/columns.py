"""Turn the columns of a file into ours: name, unit, scale, and a counter that wraps."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.table import RawTable, told_words
from firmloop.identify.units import camel_words, carried_unit, likely_unit, stem_of, unit_of

Array = NDArray[np.float64]

_TIMES = re.compile(
    r"(?i)_*(t|ts|time|stamp|timestamp|date|datetime|elapsed|clock|millis|micros|seconds?|x(_value)?|zeit|uhrzeit|datum|"
    r"unix(time)?|epoch|uptime|datenum|temps|heure|tiempo|hora|fecha|tempo|ora)"
    r"([\s_(\[].*)?"
)

_COUNTERS = frozenset(("", *"no nr number index idx count seq sample point row record".split()))
_EXAMPLE = 24.0  # of what a share is a share of: the supply of many a drive, V
_FARTHEST = 1.5  # times what a counter wraps at: half of that beyond it a jump is still told from a step


@dataclass(frozen=True, slots=True)
class Column:
    """What a column of a file is called by us, and how its numbers become ours.

    A counter is unwrapped first: `wraps` is by how much it falls, as the file counts. Then number * scale + offset is a
    value in `unit`, as printed, or in the unit that ends `name` where there is none.
    """

    name: str
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    wraps: float = 0.0

    @property
    def is_a_name(self) -> bool:
        """Tell whether the numbers stay as they are."""
        return self == Column(self.name)


@dataclass(frozen=True, slots=True)
class RowClock:
    """Rows `period` s apart, the first at `start` s: the time of a file whose time column is missing or rounded."""

    period: float
    start: float = 0.0


def called_a_time(name: str) -> bool:
    """Tell whether a column is called as a time is; capitals part words of several letters, signs one letter, too."""
    first, *others = camel_words(re.sub(r"(?<=\w{3})[&/](?=\w{3})|[.:{]", "_", name))
    parted = "_".join((first, *others)) if len(first) > 1 else first + "".join(others)
    return bool(_TIMES.fullmatch(parted) or _TIMES.fullmatch(name))


def called_a_counter(name: str) -> bool:
    """Tell whether a column is called as the number of a row is, at its end: header.seq."""
    return re.split(r"[\W_]+", name.strip(" .#"))[-1].lower() in _COUNTERS


def tells_time(name: str) -> bool:
    """Tell whether a column is called as a time is, or ends in a unit of time."""
    return called_a_time(name) or _convertible(likely_unit(name, "s"), "s")


def unit_left_out(foreign: str, name: str) -> str:
    """Return what to write where `foreign` carries a unit that renaming it to `name` would lose, else nothing."""
    wanted = unit_of(name)
    carried = likely_unit(foreign, wanted)
    last = re.split(r"[\W_]+", foreign)[-1]
    if name == "time_s" and not carried and last in ("min", "h"):  # no extreme, where it is a time
        carried = last
    if not carried or not wanted or _agree(carried, wanted):
        return ""
    line = rename_line(foreign, name, carried)
    return as_a_share(foreign, name, carried) or f"write which unit it is in: {line}"


def as_a_share(foreign: str, name: str, unit: str) -> str:
    """Return what to write where a column is in `unit`, a share such as %, and `name` is in a unit; else nothing."""
    wanted = unit_of(name)
    if not wanted or not _convertible(unit, "1") or _convertible(unit, wanted):
        return ""
    share = rename_line(foreign, name, "", conversion(unit, "1", "").factor * _EXAMPLE)
    return (
        f"{unit} is a share, so write the {wanted} that one of it stands for as the scale, such as {share} where all "
        f"of it is {_EXAMPLE:g} {wanted}"
    )


def in_another_unit(foreign: str, name: str) -> str:
    """Return the line to write where `foreign` is called as `name` is but for another unit of the same kind."""
    wanted, stem = unit_of(name), stem_of(name)
    unit = likely_unit(foreign, wanted)
    alike = bool(unit and stem and wanted) and re.split(r"[\W_]", foreign)[0].lower() == stem.lower()
    return rename_line(foreign, name, unit) if alike and _convertible(unit, wanted) else ""


def rename_line(foreign: str, name: str, unit: str, scale: float | None = None) -> str:
    """Return a line of [recordings.rename] as TOML, with a scale in place of a unit where one is given."""
    key = foreign if re.fullmatch(r"[A-Za-z0-9_-]+", foreign) else json.dumps(foreign, ensure_ascii=False)
    how = f"unit = {json.dumps(unit, ensure_ascii=False)}" if scale is None else f"scale = {scale:g}"
    return f"{key} = {{ name = {json.dumps(name)}, {how} }}"


def arranged(table: RawTable, rename: Mapping[str, Column], clock: RowClock | None, file: str) -> RawTable:
    """Return the table with our names and units.

    Raises
    ------
    IdentifyError
        naming both columns where two fit one name, and what is missing or cannot be converted.
    """
    rules = [rename.get(name, Column(name)) for name in table.names]
    names = tuple(rule.name for rule in rules)
    for position, name in enumerate(names):
        if not name:
            raise IdentifyError(f"{file}: column {position + 1} has no name; name every column in the header")
        if name in names[:position]:
            first = names.index(name)
            both = " and ".join(
                f"{table.names[k]!r} (column {k + 1}{', renamed' if table.names[k] != name else ''})"
                for k in (first, position)
            )
            alike = table.names[first] == table.names[position]  # which no line of [recordings.rename] tells apart
            remedy = "give one of them another name in the header" if alike else "rename one of them"
            raise IdentifyError(f"{file}: column {name} stands twice: {both}; {remedy}, or delete it")
    units = table.units or ("",) * len(names)
    notes = list(table.notes)
    columns = []
    for rule, foreign, printed, values in zip(rules, table.names, units, table.columns, strict=True):
        columns.append(_converted(rule, foreign, printed, values, file))
        says = printed or carried_unit(foreign)
        if rule.unit and says and _convertible(says, unit_of(rule.name)) and not _agree(says, rule.unit):
            notes.append(
                f"{foreign} is read in {rule.unit}, as [recordings.rename] has it, though the file says {says}"
            )
        if printed and not rule.unit and columns[-1] is not values:
            notes.append(f"{foreign} is converted from {printed} by its line of units")
    words = {rename.get(name, Column(name)).name: holds for name, holds in table.words.items()}
    made = replace(table, names=names, columns=tuple(columns), units=(), notes=tuple(notes), words=words)
    if clock is not None:
        return _clocked(made, clock)
    if "time_s" not in names:
        raise _no_time(table, rename, file)
    return made


def _converted(rule: Column, foreign: str, printed: str, values: Array, file: str) -> Array:
    """Return a column in the unit of its new name; the same array where nothing changes."""
    if rule.wraps:
        if np.ptp(values) > _FARTHEST * rule.wraps:
            raise IdentifyError(
                f"{file}: column {foreign} goes from {values.min():.10g} to {values.max():.10g}, and a counter that "
                f"wraps at {rule.wraps:.10g} stays within so much; wraps is counted as the file counts, before unit "
                "and scale: correct it in [recordings.rename]"
            )
        way = -1.0 if rule.scale < 0.0 and rule.name == "time_s" else 1.0  # of a timer that counts down
        values = way * going_on(way * values, rule.wraps, rule.name == "time_s")
    if rule.scale != 1.0 or rule.offset != 0.0:
        values = values * rule.scale + rule.offset
    unit = rule.unit or printed
    if not unit:
        return values
    wanted = unit_of(rule.name)
    if not wanted:
        if not rule.unit:
            return values
        raise IdentifyError(
            f"{file}: {foreign} is given in {unit}, but its new name {rule.name} ends in no unit; end it in one, "
            f"such as speed_rad_s"
        )
    if not rule.unit and foreign == rule.name:  # a name of ours and a line of units: they have to agree
        if not _agree(printed, wanted):
            raise IdentifyError(
                f"{file}: column {foreign} is named in {wanted}, but the line of units says {printed}; write in the "
                f"project which it is",
                f"[recordings.rename]\n{rename_line(foreign, rule.name, printed)}",
            )
        return values
    made = conversion(unit, wanted, f"{file}: column {foreign}")
    if rule.name == "time_s" and not made.changes_nothing and len(values) > 1:
        values = evened(values)  # whose digits are those of this unit
    return values if made.changes_nothing else values * made.factor + made.offset


def _agree(printed: str, wanted: str) -> bool:
    if printed == wanted:
        return True
    try:
        return conversion(printed, wanted, "").changes_nothing
    except IdentifyError:
        return False


def going_on(values: Array, wraps: float, is_time: bool) -> Array:
    """Add `wraps` at each fall of a clock; of a signal, which goes both ways, at each jump of more than half of it."""
    steps = np.diff(values)
    turns = -np.floor(steps / wraps) if is_time else -np.round(steps / wraps)
    return np.asarray(values + wraps * np.concatenate([[0.0], np.cumsum(turns)]))


def _clocked(table: RawTable, clock: RowClock) -> RawTable:
    """Put the clock of the rows in place of a time column."""
    time = clock.start + clock.period * np.arange(len(table.places), dtype=np.float64)
    notes = table.notes
    kept = [k for k, name in enumerate(table.names) if name != "time_s"]
    if len(kept) < len(table.names):
        own = table.columns[table.names.index("time_s")]
        away = float(np.max(np.abs((own - own[0]) - (time - time[0])))) if len(own) else 0.0
        notes = (*notes, f"time_s is counted by recordings.period_s; the file's own is up to {away:.3g} s away from it")
    names = ("time_s", *(table.names[k] for k in kept))
    return replace(table, names=names, columns=(time, *(table.columns[k] for k in kept)), notes=notes)


def _no_time(table: RawTable, rename: Mapping[str, Column], file: str) -> IdentifyError:
    """Say that there is no time, and which column may be it, or would be if it held numbers."""
    named = next((name for name in table.words if rename.get(name, Column(name)).name == "time_s"), "")
    units = table.units or ("",) * len(table.names)
    likely = [
        (name, unit or likely_unit(name, "s") or re.split(r"[\W_]+", name)[-1])
        for name, unit in zip(table.names, units, strict=True)
        if called_a_time(name) or _agree_in_kind(unit or carried_unit(name))
    ]
    wordy = named or next((name for name in table.words if called_a_time(name) and not likely), "")
    if wordy:
        is_it = "is the time, but" if named else "seems to be the time, but"
        return IdentifyError(
            f"{file}: column {wordy} {is_it} no column of numbers, it {table.words[wordy]}; write decimal numbers "
            "there, or give the time between rows, in s, as recordings.period_s, which then stands for it"
        )
    held = f"{', '.join(table.names)[:200]}{told_words(table.words)}"
    message = f"{file}: column time_s is missing; it has {held}; name the time column in [recordings.rename]"
    if not likely:
        return IdentifyError(
            f"{message}, or give the time between rows, for which 0.001 s stands here", "[recordings]\nperiod_s = 0.001"
        )
    name, unit = likely[0]
    guess = unit if _agree_in_kind(unit) else "s"
    return IdentifyError(
        f"{message}, with the unit it is in", f"[recordings.rename]\n{rename_line(name, 'time_s', guess)}"
    )


def _agree_in_kind(unit: str) -> bool:
    return bool(unit) and _convertible(unit, "s")


def _convertible(unit: str, wanted: str) -> bool:
    try:
        return conversion(unit, wanted, "").factor > 0.0
    except IdentifyError:
        return False
