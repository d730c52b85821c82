"""A reading that stands still where the plant moves: a sensor, a bus or a logger that repeats its last value.

A noisy reading repeats a value by chance for a few rows, a coarse one for more; a stretch of many times that has
another cause. A body at rest is one: a position is not asked, nor a zero, but one that is leapt to and left by a leap,
as no body stops and starts. A limit is another, of which others speak.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, run_as_given
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

_LONGER = 10.0  # times the next longest stretch
_MOVES = 0.1  # of its whole motion, that the plant as given makes meanwhile


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every output of every recording that is no position."""
    found = []
    for recording in evidence.recordings:
        run = None
        for k, signal in enumerate(evidence.given.outputs):
            if signal.name.startswith("position_") or signal.name not in recording.columns:
                continue
            stretch = _stretch(recording.columns[signal.name])
            if stretch is None or _unmoved(evidence, recording, stretch):
                continue
            run = _moving(evidence, recording) if run is None else run
            if run is not None and np.ptp(run[stretch, k]) > _MOVES * np.ptp(run[:, k]):
                found.append(_said(recording, signal.name, stretch))
    return tuple(found)


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
    time = recording.time
    ends = rows.start == 0 or rows.stop == len(time)  # then one part is left
    cure = "cut these rows out" if ends else "cut these rows out and list both parts"
    held = recording.columns[name][rows.start]
    why = "that repeated its last value" if held else "that had nothing to read"
    return (
        f"{name} of {recording.source} stands at {held:.6g} from {time[rows.start]:.6g} "
        f"to {time[rows.stop - 1]:.6g} s ({rows.stop - rows.start} rows), and elsewhere changes in nearly every row: a "
        f"sensor, a bus or a logger {why}; {cure}"
    )


CHECK = Check(
    "frozen",
    look,
    ("rest", "drift", "structure", "excitation"),
    False,
    ("diagnose",),
)
