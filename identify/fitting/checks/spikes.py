"""Readings that failed: they leap farther than all others reach, and no step of the input or no answer says why."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

_NONE: Rows = np.zeros(0, dtype=np.int64)

_FEWEST = 2  # steps of an input: of two, one may be the failed one
_MOST = 0.01  # of the rows: what comes more often is how the signal moves
_SOON = 0.05  # of the rows: within them, and its dead time, a plant begins to answer what an input did
_LATEST = 0.2  # of the rows: a fit that failed may have any dead time
_MORE = 1.2  # times as fast as it moves elsewhere: a leap of an input beyond its span moves it so
_SHARE = 0.1  # of a leap of many spans, for which an output that any of the steps moves would be no answer
_ENOUGH = 3.0  # times as fast is an answer however far an input leaps: its span may be noise alone


# What loggers and converters write where they have no reading: more than 1 % of the rows may hold one.
PLACEHOLDERS = (
    *(sign * each for each in (127.0, 999.0, 9999.0, 99999.0, 999999.0, 1e30) for sign in (1.0, -1.0)),
    *(-(2.0**bits) for bits in (15, 23, 31)),
    *(2.0**bits - 1.0 for bits in (15, 16, 23, 24, 31, 32)),
)
_CODES = 3  # times that the same number is leapt to, from which it stands for a reading that failed
_FARTHEST = 3.0  # times the farthest leap elsewhere, or the least change: so far a number is leapt to that stands so
_FARTHER = 2.0  # times what all others span, that a placeholder lies beyond them
_FEWEST_GOOD = 0.1  # of the rows that hold readings
_SMALL = 0.1  # of the first step: so little moves after it, where it was no swing or decay
_ALONE = 100.0  # spans beyond the others, from which a leap of an input needs no output to say that it has failed


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every output and every input of every recording."""
    return tuple(says for _, says in failed_readings(evidence))


def failed_readings(evidence: Evidence) -> tuple[tuple[str, str], ...]:
    """Return the signal, and the sentence, of readings that failed."""
    return tuple(
        (name, _said(recording, name, rows))
        for recording in evidence.recordings
        for name in recording.columns
        if len(rows := _failed(recording, name, evidence))
    )


def _failed(recording: Recording, name: str, evidence: Evidence) -> Rows:
    """Return the rows that leap without a cause, if they are an output's, or without an answer, if an input's."""
    values = recording.columns[name]
    inputs, outputs = (
        {each.name: recording.columns[each.name] for each in signals if each.name in recording.columns}
        for signals in (evidence.given.inputs, evidence.given.outputs)
    )
    if name not in inputs and name not in outputs:
        return _NONE
    known = _placeholders(values)
    rows = known if len(known) else _leaps(values, [*inputs.values()] if name in outputs else [])
    if not len(rows):
        return _NONE
    others = np.delete(values, rows)
    moving = np.ptp(others) > 0.0
    if name in outputs:  # where nothing else moves, one that stays may be the next count of a coarse sensor
        return rows if moving or np.all(np.diff(rows) > 1) else _NONE
    if not moving:
        return _NONE  # it is the one push of a test
    late = _dead_time(evidence) / float(np.mean(np.diff(recording.time)))
    beyond = float(np.max(np.abs(values[rows] - np.median(others))) / np.ptp(others))
    if not outputs:
        return rows if len(known) or beyond > _ALONE else _NONE
    more = min(max(_MORE, _SHARE * beyond), _ENOUGH)
    return _NONE if any(_answered(output, rows, late, more) for output in outputs.values()) else rows


def _placeholders(values: Array) -> Rows:
    """Return the rows that hold a number which stands for none, far from all others."""
    for known in np.intersect1d(PLACEHOLDERS, values):
        rows = np.flatnonzero(values == known)
        others = np.delete(values, rows)
        if len(others) < _FEWEST_GOOD * len(values):
            continue
        if np.min(np.abs(others - known)) > _FARTHER * np.ptp(others) > 0.0:
            return rows
    return _NONE


def _dead_time(evidence: Evidence) -> float:
    """Return after how long the plant begins to answer, s, as given or as fitted."""
    plants = [evidence.given, *([evidence.fit.plant] if evidence.fit else [])]
    return max(
        (each.value for plant in plants for each in plant.parameters if each.name == plant.delay and each.value > 0.0),
        default=0.0,
    )


def _answered(output: Array, rows: Rows, late: float, more: float) -> bool:
    """Tell whether an output, or its speed, changes `more` times as fast after one of the rows as anywhere else.

    A push shows in the speed of a position, hardly in how fast it moves. `late` is the plant's dead time in rows.
    """
    end = max(3, round(_SOON * len(output))) + (round(late) if late < _LATEST * len(output) else 0)
    for order in (1, 2):
        moves = np.abs(np.diff(output, order))
        soon = np.zeros(len(moves), dtype=bool)
        for row in rows:
            soon[max(0, row + 1 - order) : row + end] = True
        if np.max(moves[soon], initial=0.0) > more * np.max(moves[~soon], initial=0.0):
            return True
    return False


def _leaps(values: Array, drives: Sequence[Array]) -> Rows:
    """Return the rows that leap away and back by more than what all the others span, or alone; what stays is one."""
    first = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    kept = values[first]
    there, back = kept[1:-1] - kept[:-2], kept[1:-1] - kept[2:]
    leap = np.zeros(len(values))
    leap[first[1:-1]] = np.where(there * back > 0.0, np.minimum(np.abs(there), np.abs(back)), 0.0)
    if drives and len(kept) > 2 and not any(drive[0] for drive in drives):  # nothing answers an input yet
        start, after = abs(kept[1] - kept[0]), abs(kept[2] - kept[1])
        leap[0] = start if after < _SMALL * start else 0.0
    for drive in drives:
        _take_answers(leap, np.diff(drive))
    if drives and len(code := _same_number(values, leap, first)):
        return code
    most = 1 + int(_MOST * len(values))
    leapt = np.flatnonzero(leap > 0.0)
    away = np.abs(values[leapt] - np.median(values))  # between two that failed a good one leaps, too, but not so far
    ranked = leapt[np.argsort(-away)][:most]
    runs = np.searchsorted(first, ranked)  # each holds one value
    ends = np.append(first[1:], len(values))[runs]
    highest, lowest = (_beside(kept, runs, extreme) for extreme in (np.maximum, np.minimum))
    few = np.cumsum(ends - ranked) <= most
    found = np.flatnonzero(few & (np.minimum.accumulate(leap[ranked]) > highest - lowest))
    if not len(found):
        return _alone(kept, first, leap) if drives else _NONE
    return np.sort(np.concatenate([np.arange(ranked[k], ends[k]) for k in range(int(found[-1]) + 1)]))


def _same_number(values: Array, leap: Array, first: Rows) -> Rows:
    """Return the rows that leap to one number, again and again, though other readings may come near it."""
    number = values[int(np.argmax(leap))]
    away = values != number
    beside = np.zeros(len(values), dtype=bool)
    beside[:-1] |= ~away[1:]
    beside[1:] |= ~away[:-1]
    steps = np.abs(np.diff(values))
    usual = max(float(np.max(leap[away & ~beside], initial=0.0)), float(np.min(steps[steps > 0.0], initial=np.inf)))
    found = np.flatnonzero(~away & (leap > _FARTHEST * usual))
    if len(found) < _CODES:
        return _NONE
    ends = np.append(first[1:], len(values))[np.searchsorted(first, found)]
    return np.concatenate([np.arange(*run) for run in zip(found, ends, strict=True)])


def _alone(kept: Array, first: Rows, leap: Array) -> Rows:
    """Return the rows that leap away and back `_FARTHEST` times as far as any two other readings are apart.

    A fast motion shows in the rows around it: of a bounce the rows before and behind are as far apart. `kept` are the
    readings that differ from the one before, and `first` their rows.
    """
    rows = np.diff(np.append(first, len(leap)))
    alone = np.where(rows <= np.median(rows), leap[first], 0.0)  # one that stays for longer may be a rest
    ranked = np.argsort(-alone)[: int(_MOST * len(kept))]
    steps = np.abs(np.diff(kept))
    found = 0
    for count, run in enumerate(ranked, 1):
        steps[max(run - 1, 0) : run + 1] = 0.0  # to it and from it
        if alone[run] > _FARTHEST * np.max(steps) > 0.0:
            found = count
    return np.sort(np.concatenate([_NONE, *(np.arange(first[run], first[run] + rows[run]) for run in ranked[:found])]))


def _beside(kept: Array, ranked: Rows, extreme: np.ufunc) -> Array:
    """Return the extreme of all values but the first, the first two, ... of those ranked, the last for all of them."""
    others = extreme.reduce(np.delete(kept, ranked))
    return np.asarray(extreme.accumulate(np.append(others, kept[ranked][::-1]))[:-1][::-1])


def _take_answers(leap: Array, steps: Array) -> None:
    """Take from the leaps what a step of the input explains: as much, for its size, as the others are answered by."""
    moved = np.flatnonzero(steps)
    sizes = np.abs(steps[moved])
    rows = np.minimum(moved + 1, len(leap) - 1), np.minimum(moved + 2, len(leap) - 1)
    answers = np.maximum(leap[rows[0]], leap[rows[1]])
    usual = float(np.median(answers / sizes)) if len(moved) > _FEWEST else np.inf
    for after in rows:
        explained = np.zeros(len(leap))
        np.maximum.at(explained, after, usual * sizes)
        leap -= np.minimum(leap, explained)


def _said(recording: Recording, name: str, rows: Rows) -> str:
    k, values = int(rows[0]), recording.columns[name]
    after = next((each for each in range(k + 1, len(values)) if each not in rows), k)
    place = f"between {values[k - 1]:.4g} and" if k else "before"
    alone = np.min(np.abs(np.delete(values, rows) - values[k])) > 0.5 * abs(values[after] - values[k])
    why = "none else comes near" if alone else "no other is leapt to and left like that"
    more = "" if len(rows) == 1 else f", and {len(rows) - 1} more such" if len(rows) > 2 else ", and one more such"
    return (
        f"{name} of {recording.source} reads {values[k]:.6g} at {recording.time[k]:.6g} s, {place} {values[after]:.4g}"
        f"{more}: a reading that failed, for {why}; delete the row"
        f"{'s' if len(rows) > 1 else ''}"
    )


CHECK = Check(
    "spikes",
    look,
    ("frozen", "rest", "drift", "structure", "scale", "motor_constants", "excitation"),
    False,
    ("diagnose",),
)
