"""Rows that a column counts and the clock does not: all behind them is too early, whatever the plant."""

from __future__ import annotations

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.recordings.lost_rows import uncounted


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every recording, in the words of its own note."""
    return tuple(
        f"{recording.source}: {says}"
        for recording in evidence.recordings
        for says in uncounted(recording.time, recording.columns)
    )


CHECK = Check(
    "lost_rows",
    look,
    ("clock_unit", "sign", "scale", "motor_constants", "rest", "drift", "structure", "spikes", "excitation"),
    False,
    ("diagnose",),
)
