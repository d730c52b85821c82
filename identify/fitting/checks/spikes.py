"""Readings that failed: one row leaps farther than all others reach, and no step of the input says why."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

_FEWEST = 2  # steps of an input: of two, one may be the failed one
_MOST = 0.01  # of the rows: what comes more often is how the signal moves


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every output of every recording."""
    return tuple(
        _said(recording, signal.name, rows)
        for recording in evidence.recordings
        for signal in evidence.given.outputs
        if signal.name in recording.columns and len(rows := _leaps(recording, signal.name, evidence))
    )


def _leaps(recording: Recording, name: str, evidence: Evidence) -> NDArray[np.int64]:
    """Return the rows that leap away and back by more than what all the others span."""
    values = recording.columns[name]
    leap = np.zeros(len(values))
    there, back = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    leap[1:-1] = np.where(there * back > 0.0, np.minimum(np.abs(there), np.abs(back)), 0.0)
    for drive in evidence.given.inputs:
        if drive.name in recording.columns:
            _take_answers(leap, np.diff(recording.columns[drive.name]))
    ranked = np.argsort(-leap)[: 1 + int(_MOST * len(values))]
    for count in range(len(ranked), 0, -1):
        if leap[ranked[count - 1]] > np.ptp(np.delete(values, ranked[:count])):
            return np.sort(ranked[:count])
    return np.zeros(0, dtype=np.int64)


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


def _said(recording: Recording, name: str, rows: NDArray[np.int64]) -> str:
    k, values = int(rows[0]), recording.columns[name]
    more = "" if len(rows) == 1 else f", and {len(rows) - 1} more such" if len(rows) > 2 else ", and one more such"
    return (
        f"{name} of {recording.source} reads {values[k]:.6g} at {recording.time[k]:.6g} s, between {values[k - 1]:.4g} "
        f"and {values[k + 1]:.4g}{more}: a reading that failed, for none else comes near; delete the row"
        f"{'s' if len(rows) > 1 else ''}"
    )


CHECK = Check("spikes", look, ("rest", "drift", "structure", "scale", "motor_constants", "excitation"), False)
