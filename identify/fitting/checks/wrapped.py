"""An angle that wraps: it leaps from one end of a turn or of a counter to the other, and a plant's angle goes on."""

from __future__ import annotations

import math

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, sources_of
from firmloop.identify.recordings.wrapping import TURN, wrap_of

_TURNS = ((360.0, "degrees", 'unit = "deg", wraps = 360'), (1.0, "turns", 'unit = "rev", wraps = 1'))


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every angle of the plant, and whatever has no unit and is counted, whether it wraps in all recordings."""
    angles = [signal.name for signal in evidence.given.outputs if signal.unit == "rad"]
    counts = [signal.name for signal in evidence.given.outputs if not signal.unit and _counts(evidence, signal.name)]
    wraps = {name: wrap_of(evidence.recordings, name) for name in (*angles, *counts)}
    return tuple(
        _said_of_counts(evidence, name, size) if name in counts else _said(evidence, name, size)
        for name, size in wraps.items()
        if size is not None
    )


def _counts(evidence: Evidence, name: str) -> bool:
    return all(np.array_equal(each.columns[name], np.round(each.columns[name])) for each in evidence.recordings)


def _end_of(size: float) -> int:
    """Return where a counter wraps that falls by `size`, as far as that is measured."""
    bits = 2 ** round(math.log2(size))
    return bits if abs(size / bits - 1.0) < TURN else round(size)


def _said_of_counts(evidence: Evidence, name: str, size: float) -> str:
    return (
        f"{name} of {sources_of(evidence.recordings)} leaps by {size:.6g} from one end of its range to the other, "
        "against its motion: a counter that wraps; write in [recordings.rename], with the file's own name on the left, "
        f'{name} = {{ name = "{name}", wraps = {_end_of(size)} }}'
    )


def _said(evidence: Evidence, name: str, size: float) -> str:
    source = sources_of(evidence.recordings)
    if abs(size / math.tau - 1.0) < TURN:
        return (
            f"{name} of {source} leaps by a whole turn from one end of its range to the "
            "other, against its motion: a reading that wraps; write in its line of [recordings.rename] by how much the "
            "file's own numbers fall there: wraps = 360 of degrees, 6.283185307 of rad, 4096 of 12 bits"
        )
    leaps = (
        f"{name} of {source} leaps by {size:.6g} from one end of its range to the other, against its motion: a reading "
        "that wraps, and at no turn in rad"
    )
    for turn, unit, keys in _TURNS:
        if abs(size / turn - 1.0) < TURN:
            line = f'{name} = {{ name = "{name}", {keys} }}'
            return f"{leaps} but in {unit}: write in [recordings.rename], with the file's own name on the left, {line}"
    if not _counts(evidence, name):
        return f"{leaps}: write in its line of [recordings.rename] by how much the file's own numbers fall there"
    counts = _end_of(size)
    return (
        f"{leaps}: are these counts? then write in [recordings.rename], with the file's own name on the left, "
        f'{name} = {{ name = "{name}", scale = {math.tau / counts:.10g}, wraps = {counts} }} for {counts} counts a '
        f"turn, or another scale of 6.283185307 / counts a turn where {counts} is the counter's end"
    )


CHECK = Check(
    "wrapped",
    look,
    ("rest", "drift", "structure", "scale", "sign", "swapped", "excitation", "motor_constants", "far_from_given"),
    False,
)
