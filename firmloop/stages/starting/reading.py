"""Read recordings under guessed names, and take the cure that a complaint about a file's clock prints."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion
from firmloop.identify.recordings.columns import Column, RowClock, called_a_counter, rename_line
from firmloop.identify.recordings.guess import (
    Guessed,
    apart,
    guess_columns,
    guess_time,
    refuse_twins,
    rename_of,
)
from firmloop.identify.recordings.recording import Recording, read_raw, recording_of
from firmloop.identify.recordings.table import RawTable, to_numbers, told_words
from firmloop.identify.recordings.wrapping import wraps_at_a_turn
from firmloop.identify.simulation.linear_filter import filtered
from firmloop.identify.units import is_in, likely_unit, unit_of
from firmloop.stages.starting.direction import refuse_without_direction
from firmloop.stages.starting.unrolled import unrolled

Array = NDArray[np.float64]

POSITION = "position_rad"  # what an output without a unit is taken for that integrates

_LAGS, _LONGEST_LAG = 20, 5.0  # tried, and what part of the recording the longest one is
_EXPLAINED = 0.9  # of what moves besides a straight line, from which an output is told by the drive
_RATHER = 0.25  # of what a lag leaves: an integral that leaves less is the better explanation
_HELD = 0.1  # of the rows: a reading repeats so many by its coarse steps alone
_CLEARLY = 0.05  # of what a lag explains: how much more one way than the other
_FOLLOWS = 0.7  # correlation with a command: half of what a signal does goes with it
_DECIMAL = "write decimal numbers there"
_FREELY = (
    "; init cannot tell what moves by itself, as a free decay: write its project by hand, with {} as plant.input and "
    "the equations that you expect (kind ode, or a stage of a machine)"
)
_STEP = re.compile(r"(?i)(dt|delta_?t|d_?time|delta_?time|time_?step|time_?delta|interval)(?![a-z])")
_CURES = 3  # that a file's clock may take one after the other: a counter that wraps, then lost digits


@dataclass(frozen=True, slots=True)
class _File:
    """A file, and what `read_raw` has found in it: each is read once, however many guesses are tried."""

    path: Path
    raw: RawTable
    digest: str


@dataclass(frozen=True, slots=True)
class Guesses:
    """The recordings as guessed: `used` are the columns that are read, `time` first where there is one."""

    recordings: tuple[Recording, ...]
    rename: Mapping[str, Column]
    clock: RowClock | None
    time: Guessed | None
    input: Guessed
    outputs: tuple[Guessed, ...]
    asides: tuple[str, ...]


def read_guessed(paths: Sequence[Path], period: float | None, left_out: Sequence[str]) -> Guesses:
    """Read every file by what the first one's columns seem to be.

    `period` is the time between rows, s, where the files have none; `left_out` names columns that count as nothing.

    Raises
    ------
    IdentifyError
        when there is no time, no input or no output, when two columns seem to be one, or a file lacks a column.
    """
    files, read_as = _with_needed_states([_File(path, *read_raw(path)) for path in paths])
    first, file = _without(files[0].raw, left_out, paths[0]), str(paths[0])
    time = None if period is not None else guess_time(first)
    if time is None and period is None:
        raise IdentifyError(
            f"{file}: no column seems to be the time; it has {', '.join(first.names)[:200]}{told_words(first.words)}; "
            f"{f'{to_numbers(first.words.values(), _DECIMAL)}, or ' if first.words else ''}{_unnamed_clock(first)}"
            "give the time between two rows, s, such as --period 0.001"
        )
    if time is not None and np.all(np.diff(clock_of := first.columns[first.names.index(time.foreign)]) <= 0.0):
        raise IdentifyError(
            f"{file}: column {time.foreign} falls from {clock_of[0]:.10g} to {clock_of[-1]:.10g}: turn the rows "
            "around, if the last one came first; if they are in order and the clock counts down, write its project by "
            f"hand, with {rename_line(time.foreign, 'time_s', time.unit).removesuffix(' }')}, scale = -1.0 }}"
        )
    columns = guess_columns(first, time)
    first, levels = _with_levels(first, [each.raw for each in files[1:]], columns)
    held = dict(zip(first.names, first.columns, strict=True))
    still = tuple(each for each in columns if np.ptp(held[each.foreign]) == 0.0)
    counts = [each for each in columns if _counts(each, held[each.foreign])]
    # What is read from a plant moves within a recording: where it only differs from one to the next, it is no answer.
    still += tuple(each for each in columns if each.foreign in levels and each.reads > 0 and not each.reference)
    moving = tuple(each for each in columns if each not in still and each not in counts and not each.reference)
    asked = sorted(
        (each for each in columns if each not in still and each.reference), key=lambda each: not each.commands
    )
    if not moving or len(moving) + len(asked) < 2:
        there = ", ".join(each.foreign for each in (*moving, *asked)) or "none"
        alone = _FREELY.format(still[0].foreign if still else "a column of zeros") if moving and not first.words else ""
        cure = f"; {to_numbers(first.words.values(), f'{_DECIMAL}, such as 0 and 1')}" if first.words else ""
        raise IdentifyError(
            f"{file}: an input and what answers it are needed: two columns that change besides the time; it has {there}"
            f"{told_words(first.words)}{cure}{alone}"
        )
    first, words = unrolled(first, moving)
    pushed = _pushed(moving, first, levels)
    # Nothing is named as a drive: what an inner loop is asked for moves the plant, not what is read from it.
    if asked and pushed.drives <= 0 and (asked[0].commands or pushed.reads > 0):
        pushed = asked[0]
    stays = next((each for each in still if each.drives > 0), None)
    if pushed.drives < 0 and stays is not None:
        raise IdentifyError(
            f"{file}: {stays.foreign}, called as what drives a plant is, never changes, and {pushed.foreign} is called "
            f"as what is read from one: record {stays.foreign} as it changes{_FREELY.format(stays.foreign)}"
        )
    drive, others = pushed.alone(columns), tuple(each for each in moving if each is not pushed)
    others = tuple(each for each in others if each.foreign not in levels)
    if not others:
        raise IdentifyError(
            f"{file}: besides the time, no column changes within any recording but what drives the plant "
            f"({drive.foreign}): record what answers it, too"
        )
    outputs = tuple(_placed(drive, each, others, first) for each in _outputs(drive, others, first))
    refuse_without_direction(drive, outputs, first, file, _lagging)
    if len(others) == 1 and len(outputs) == 1:  # of which none can be left out
        drive, answer = apart(drive, outputs[0])
        outputs, moving = (answer,), (drive, answer)
    used = (*((time,) if time else ()), drive, *outputs)
    refuse_twins(used, moving, file)
    rename, clock = rename_of(used), None if period is None else RowClock(period)
    recordings, rename, clock = _read(files, rename, clock)
    turning = {each.foreign: each for each in outputs if wraps_at_a_turn(recordings, each.name)}
    counting = {each.foreign: each for each in outputs if each.foreign in words}
    if turning or counting:
        wraps = {foreign: replace(each.column, wraps=_turn(each.unit)) for foreign, each in turning.items()}
        wraps |= {foreign: replace(each.column, wraps=words[foreign]) for foreign, each in counting.items()}
        recordings, rename, clock = _read(files, {**rename, **wraps}, clock)
    named = [each.foreign for each in used]
    asides = [_aside(each, each in still, levels, outputs[0].foreign) for each in columns if each.foreign not in named]
    asides += [f"column {name} is read as {says}" for name, says in read_as.items()]
    asides += [f"column {name} {holds} and is not used" for name, holds in first.words.items() if name not in left_out]
    return Guesses(recordings, rename, clock, time, drive, outputs, tuple(asides))


def _with_needed_states(files: list[_File]) -> tuple[list[_File], dict[str, str]]:
    """Take columns of two words, such as ON and OFF, as numbers where what drives the plant is among them alone.

    Also return how each of them is read.
    """
    first = files[0].raw
    numbers = guess_columns(first, guess_time(first))
    enough = len(numbers) > 1 and any(each.drives > 0 and not each.reference for each in numbers)
    if enough or not first.states:
        return files, {}
    whole = first.with_states(first.states)
    driving = [each.foreign for each in guess_columns(whole, guess_time(whole)) if each.drives > 0]
    needed = {name: says for name, (_, says) in first.states.items() if name in driving or len(numbers) < 2}
    return [replace(each, raw=each.raw.with_states(needed)) for each in files], needed


def _counts(column: Guessed, values: Array) -> bool:
    """Tell whether a column counts rows, or is called as one more clock and rises all the time."""
    steps = np.diff(values)
    clock = re.search("(?i)stamp|time|clock", column.foreign)
    return not column.quantity and bool(
        (called_a_counter(column.foreign) and np.all(steps == 1.0)) or (clock and np.all(steps > 0.0))
    )


def _unnamed_clock(table: RawTable) -> str:
    """Say what to make of a column that rises evenly, as a clock does, or holds steps of time; empty without one."""
    for name, values in zip(table.names, table.columns, strict=True):
        if _STEP.match(name) and np.min(values) > 0.0:
            cure = "write its running sum into a column time_s"
            if np.ptp(values) == 0.0 and is_in(unit := likely_unit(name, "s") or "s", "s"):
                cure = f"give --period {values[0] * conversion(unit, 's', name).factor:g}"
            return f"{name} seems to be the time from row to row: {cure}; else "
    steps = ((name, np.diff(values)) for name, values in zip(table.names, table.columns, strict=True))
    even = (name for name, each in steps if len(each) and 0.5 * np.max(each) < np.min(each))
    name = next(even, "")
    return (
        f"if {name}, which rises in every row, is it, call it time_s in the header, or time_ms; else " if name else ""
    )


def _without(table: RawTable, left_out: Sequence[str], path: Path) -> RawTable:
    for name in left_out:
        if name not in (*table.names, *table.words):
            raise IdentifyError(f"--leave-out {name}: {path} has no such column; it has {', '.join(table.names)[:200]}")
    kept = [k for k, name in enumerate(table.names) if name not in left_out]
    units = tuple(table.units[k] for k in kept) if table.units else ()
    return replace(
        table,
        names=tuple(table.names[k] for k in kept),
        columns=tuple(table.columns[k] for k in kept),
        units=units,
        states={name: state for name, state in table.states.items() if name not in left_out},
    )


def _with_levels(
    first: RawTable, others: Sequence[RawTable], columns: Sequence[Guessed]
) -> tuple[RawTable, frozenset[str]]:
    """Return the rows to judge columns by, and which columns only differ from recording to recording, as steps may.

    A column that never changes in the first file is looked up in the others, whose rows then follow its own.
    """
    values = dict(zip(first.names, first.columns, strict=True))
    still = [each.foreign for each in columns if np.ptp(values[each.foreign]) == 0.0]
    if not still:
        return first, frozenset()
    tables = [first, *(table for table in others if set(first.names) <= set(table.names))]
    parts = {name: [table.columns[table.names.index(name)] for table in tables] for name in first.names}
    differ = [name for name in still if np.ptp(np.concatenate(parts[name])) > 0.0]
    if not differ:
        return first, frozenset()
    levels = frozenset(name for name in differ if not any(np.ptp(part) for part in parts[name]))
    return replace(first, columns=tuple(np.concatenate(parts[name]) for name in first.names)), levels


def _pushed(moving: Sequence[Guessed], table: RawTable, levels: Collection[str]) -> Guessed:
    """Return what most likely moves the plant: what is named so, and the known quantity of several.

    Of two that are named so, one that changes within a recording is rather it than a level of each, such as a load.

    Of two alone that are of one quantity, or named alike, it is the one that the other follows, as far as that shows.

    A voltage beside a command is that of its supply where it does not follow it; a force or torque is what the drive
    gives where it moves something that is recorded too, else it is read from the plant.
    """
    if len(moving) == 2 and (followed := _followed(moving[0], moving[1], table)):
        return followed
    if {each.quantity for each in moving} == {"voltage_V", "current_A"}:  # either of which may be what is set
        set_ones = [each for each in moving if _held(table, each.foreign) > _HELD]
        if len(set_ones) == 1:
            return set_ones[0]
    best = max(
        moving,
        key=lambda each: (each.drives, each.foreign not in levels, each.known, _held(table, each.foreign)),
    )
    sent = [each for each in moving if each.sent and each.drives > 0]
    if best.sent or not sent or best.quantity not in ("voltage_V", "force_N", "torque_N_m"):
        return best
    command = max(sent, key=lambda each: (each.drives, _held(table, each.foreign)))
    own, given = (table.columns[table.names.index(each.foreign)] for each in (best, command))
    follows = float(np.corrcoef(own, given)[0, 1]) > _FOLLOWS
    moves = any(each.quantity.startswith(("speed_", "position_")) for each in moving)
    return best if follows and (moves or best.quantity == "voltage_V") else command


def _followed(one: Guessed, other: Guessed, table: RawTable) -> Guessed | None:
    """Return which of two columns the other lags behind; None where names tell, one is held, or neither is clear."""
    named = one.drives != other.drives and (not one.quantity or one.quantity != other.quantity)
    if named or max(_held(table, each.foreign) for each in (one, other)) > _HELD:
        return None
    first, second = (table.columns[table.names.index(each.foreign)] for each in (one, other))
    forth, back = _lagging(first, second), _lagging(second, first)
    return None if abs(forth - back) < _CLEARLY else one if forth > back else other


def _held(table: RawTable, foreign: str) -> float:
    """Return the share of rows that repeat the one before: a command is held, a reading has noise."""
    return float(np.mean(np.diff(table.columns[table.names.index(foreign)]) == 0.0))


def _outputs(drive: Guessed, others: tuple[Guessed, ...], table: RawTable) -> tuple[Guessed, ...]:
    """Return what the plant is read by: of a motor its speed, else its angle, and its current; else one column.

    Where names do not tell, it is the one that a lag behind the drive explains best.
    """
    by_name = {each.name: each for each in reversed(others)}
    moved = next((by_name[name] for name in ("speed_rad_s", "position_rad") if name in by_name), None)
    if moved and drive.name == "voltage_V":
        return (moved, *((by_name["current_A"],) if "current_A" in by_name else ()))
    placed = next((by_name[name] for name in ("position_m", "position_rad") if name in by_name), None)
    most = max((each.reads, each.known) for each in others)
    likely = [each for each in others if (each.reads, each.known) == most]
    values = {name: values for name, values in zip(table.names, table.columns, strict=True)}
    best = max(likely, key=lambda each: _lagging(values[drive.foreign], values[each.foreign]) if len(likely) > 1 else 0)
    return (placed or best.alone((drive, *others)),)


def _placed(drive: Guessed, output: Guessed, others: Sequence[Guessed], table: RawTable) -> Guessed:
    """Take an output without a unit that integrates the drive for a position, as the counts of an encoder are."""
    values = {name: values for name, values in zip(table.names, table.columns, strict=True)}
    free = not output.unit and not output.quantity and not unit_of(output.name)
    if not free or any(each.name == POSITION for each in others):
        return output
    return replace(output, name=POSITION) if integrates(values[drive.foreign], values[output.foreign]) else output


def integrates(drive: Array, values: Array) -> bool:
    """Tell whether a signal (n,) goes on where the drive (n,) stays: the integral of a lag explains it, and no lag.

    Both beside a straight line, lags up to the length of the recording, and the rows taken as even.
    """
    rows = np.arange(len(values), dtype=float)
    line = np.linalg.qr(np.column_stack([np.ones(len(rows)), rows]))[0]

    def left(shown: Array) -> float:
        shown = shown - line @ (line.T @ shown)
        power = float(shown @ shown)
        return size - float(shown @ bare) ** 2 / power if power > 0.0 else size

    bare = values - line @ (line.T @ values)
    size = float(bare @ bare)
    lags = [_lagged(drive, each) for each in np.geomspace(1.0, max(float(len(values)), 2.0), _LAGS)]
    integral = min(left(np.cumsum(each)) for each in lags)
    return integral < (1.0 - _EXPLAINED) * size and integral < _RATHER * min(left(each) for each in lags)


def _turn(unit: str) -> float:
    """Return a turn as a file counts it whose unit is given, none for rad."""
    return float(f"{math.tau / (conversion(unit, 'rad', '').factor if unit else 1.0):.10g}")


def _lagging(drive: Array, values: Array) -> float:
    """Return the largest share of a signal (n,) that one lag behind the drive (n,) explains, its rows taken as even."""
    away, shares = values - np.mean(values), [0.0]
    for rows in np.geomspace(1.0, max(len(drive) / _LONGEST_LAG, 2.0), _LAGS):
        shown = _lagged(drive, rows)
        shown = shown - np.mean(shown)
        size = float(np.linalg.norm(shown) * np.linalg.norm(away))
        shares.append((float(shown @ away) / size) ** 2 if size > 0.0 else 0.0)
    return max(shares)


def _lagged(drive: Array, rows: float) -> Array:
    """Return a drive (n,) behind a lag of so many rows, from its first value on."""
    stays = float(np.exp(-1.0 / rows))
    return filtered(np.array([0.0, 1.0 - stays]), np.array([1.0, -stays]), drive - drive[0])


def _aside(each: Guessed, still: bool, levels: Collection[str], output: str) -> str:
    if each.foreign in levels:
        return f"column {each.foreign} only differs from recording to recording and is not used"
    if still:
        return f"column {each.foreign} never changes and is not used"
    if each.reference:
        return f"column {each.foreign} seems to be a reference and is not used"
    also = f'; if it moves {output}, too, write kind = "ode" with both as inputs' if each.drives > 0 else ""
    return f"column {each.foreign} is not used{also}"


def _read(
    files: Sequence[_File], rename: Mapping[str, Column], clock: RowClock | None
) -> tuple[tuple[Recording, ...], Mapping[str, Column], RowClock | None]:
    """Name the columns of all files in one way; a complaint that prints lines to paste is answered by them."""
    for _ in range(_CURES):
        try:
            return _named(files, rename, clock), rename, clock
        except IdentifyError as error:
            if not error.paste:
                raise
            said: dict[str, Any] = tomllib.loads(error.paste)
            part = said.get("recordings", {})
            if "period_s" in part:
                clock = RowClock(float(part["period_s"]), float(part.get("start_s", 0.0)))
            rename = {**rename, **{key: Column(**column) for key, column in part.get("rename", {}).items()}}
    return _named(files, rename, clock), rename, clock


def _named(files: Sequence[_File], rename: Mapping[str, Column], clock: RowClock | None) -> tuple[Recording, ...]:
    return tuple(recording_of(each.path, each.raw, each.digest, rename, clock=clock) for each in files)
