"""A reading that stands still where the plant moves: a sensor, a bus or a logger that repeats its last value.

A noisy reading repeats a value by chance for a few rows, a coarse one for more; a stretch of many times that has
another cause. A body at rest is one: a position is asked only where it leaps afterwards, and a zero where it is leapt
to and left by a leap, as no body stops and starts. A limit is another, of which others speak.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, run_as_given
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

_LONGER = 10.0  # times the next longest stretch
_ROWS = 10  # that a reading stands still, at least
_ROW = 2.0  # times the most that the reading moves in a row but for these
_AGAIN = 3  # times, that a reading freezes in one recording
_COARSE = 5.0  # times the least that a reading changes by
_MOVES = 0.1  # of its whole motion, that the plant as given makes meanwhile


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every output of every recording; a position, which a body at rest keeps, only whether it leaps then."""
    found = []
    for recording in evidence.recordings:
        run = None
        for k, signal in enumerate(evidence.given.outputs):
            if signal.name not in recording.columns:
                continue
            values = recording.columns[signal.name]
            stretch = None if signal.name.startswith("position_") else _stretch(values)
            if stretch is None:
                late = None if evidence.fit is None else _caught_up(evidence.fit.plant, recording, values, k)
                found += [] if late is None else [_told(recording, signal.name, *late)]
                continue
            if _unmoved(evidence, recording, stretch):
                continue
            run = _moving(evidence, recording) if run is None else run
            if run is not None and np.ptp(run[stretch, k]) > _MOVES * np.ptp(run[:, k]):
                found.append(_said(recording, signal.name, stretch))
    return tuple(found)


def _caught_up(plant: Plant, recording: Recording, values: Array, output: int) -> tuple[slice, str] | None:
    """Return where a reading stands among others as long, and then makes up in one row for what it has missed.

    That is by far more than it can be read to, about what the plant as fitted has moved meanwhile, and more than the
    reading moves in a row elsewhere. What does so again and again is read less often than it is logged.
    """
    steps = np.abs(np.diff(values))
    ends = np.flatnonzero(steps) + 1
    stood = bool(np.any(np.diff(ends, prepend=0) >= _ROWS))
    run = run_as_given(plant, recording) if stood else None  # a simulation, that most readings can do without
    if run is None:
        return None
    usual = float(np.sort(steps)[-_AGAIN - 1]) if len(steps) > _AGAIN else 0.0
    least = max(_MOVES * float(np.ptp(run[:, output])), _COARSE * float(np.min(steps[steps > 0.0])), _ROW * usual)
    found = []
    for begin, end in zip((0, *ends[:-1]), ends, strict=True):
        if end - begin < _ROWS or values[begin] == 0.0:
            continue
        leap, moved = values[end] - values[begin], run[end, output] - run[begin, output]
        if min(abs(leap), abs(moved)) > least and 0.5 < leap / moved < 2.0:
            found.append((abs(leap), slice(int(begin), int(end))))
    if not found or len(found) > _AGAIN:
        return None
    leap, rows = max(found, key=lambda each: each[0])
    return rows, f"{leap:.3g}"


def _moving(evidence: Evidence, recording: Recording) -> Array | None:
    """Run the plant as given; where a value is missing, as fitted."""
    run = run_as_given(evidence.given, recording)
    return run_as_given(evidence.fit.plant, recording) if run is None and evidence.fit is not None else run


def _unmoved(evidence: Evidence, recording: Recording, rows: slice) -> bool:
    """Tell whether no input has changed before its last row: what the plant as given does there is its beginning."""
    drives = (recording.columns[signal.name][: rows.stop - 1] for signal in evidence.given.inputs)
    return all(np.ptp(drive) == 0.0 for drive in drives)


def _stretch(values: Array) -> slice | None:
    """Return the rows in which a reading stands still for far longer than elsewhere, away from zero and its limits."""
    ends = np.flatnonzero(np.diff(values, append=np.nan) != 0.0) + 1
    lengths = np.diff(ends, prepend=0)
    longest = int(np.argmax(lengths))
    others = np.delete(lengths, longest)
    if not len(others) or lengths[longest] < _LONGER * int(others.max()):
        return None
    rows = slice(int(ends[longest] - lengths[longest]), int(ends[longest]))
    held = values[rows.start]
    return None if held in (0.0, values.min(), values.max()) and not _leapt(values, rows) else rows


def _leapt(values: Array, rows: slice) -> bool:
    """Tell whether a reading goes to a stretch and from it by more than it moves in a row anywhere else."""
    edges = [edge for edge in (rows.start - 1, rows.stop - 1) if 0 <= edge < len(values) - 1]
    steps = np.abs(np.diff(values))
    return bool(len(edges) > 1 and np.min(steps[edges]) > np.max(np.delete(steps, edges), initial=0.0))


def _said(recording: Recording, name: str, rows: slice) -> str:
    why = "that repeated its last value" if recording.columns[name][rows.start] else "that had nothing to read"
    return f"{_stands(recording, name, rows)}, and elsewhere changes in nearly every row: {_cure(recording, rows, why)}"


def _told(recording: Recording, name: str, rows: slice, leap: str) -> str:
    made_up = f"and then leaps by {leap}, as far as the plant has moved meanwhile"
    return f"{_stands(recording, name, rows)}, {made_up}: {_cure(recording, rows, 'that repeated its last value')}"


def _stands(recording: Recording, name: str, rows: slice) -> str:
    time = recording.time
    return (
        f"{name} of {recording.source} stands at {recording.columns[name][rows.start]:.6g} from "
        f"{time[rows.start]:.6g} to {time[rows.stop - 1]:.6g} s ({rows.stop - rows.start} rows)"
    )


def _cure(recording: Recording, rows: slice, why: str) -> str:
    ends = rows.start == 0 or rows.stop == len(recording.time)  # then one part is left
    return f"a sensor, a bus or a logger {why}; " + (
        "cut these rows out" if ends else "cut these rows out and list both parts"
    )


CHECK = Check(
    "frozen",
    look,
    ("rest", "drift", "structure", "excitation"),
    False,
    ("diagnose",),
)
