"""An angle that wraps: it leaps from one end of a turn to the other, and a plant's angle goes on."""

from __future__ import annotations

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.recordings.wrapping import wraps_at_a_turn


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every angle of the plant whether it wraps at a turn in all recordings together."""
    return tuple(
        f"{signal.name} of {evidence.recordings[0].source} leaps by a whole turn from one end of its range to the "
        "other, against its motion: a reading that wraps; write in its line of [recordings.rename] by how much the "
        "file's own numbers fall there: wraps = 360 of degrees, 6.283185307 of rad, 4096 of 12 bits"
        for signal in evidence.given.outputs
        if signal.unit == "rad" and wraps_at_a_turn(evidence.recordings, signal.name)
    )


CHECK = Check(
    "wrapped",
    look,
    ("rest", "drift", "structure", "scale", "sign", "swapped", "excitation"),
    False,
)
