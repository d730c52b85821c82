"""An angle that wraps: it leaps from one end of a turn or of a counter to the other, and a plant's angle goes on."""

from __future__ import annotations

import math

import numpy as np

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, sources_of
from firmloop.identify.recordings.wrapping import TURN, wrap_of

_TURNS = ((360.0, "degrees", 'unit = "deg", wraps = 360'), (1.0, "turns", 'unit = "rev", wraps = 1'))


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask every angle of the plant whether it wraps in all recordings together."""
    angles = [signal.name for signal in evidence.given.outputs if signal.unit == "rad"]
    wraps = {name: wrap_of(evidence.recordings, name) for name in angles}
    return tuple(_said(evidence, name, size) for name, size in wraps.items() if size is not None)


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
    if not all(np.array_equal(each.columns[name], np.round(each.columns[name])) for each in evidence.recordings):
        return f"{leaps}: write in its line of [recordings.rename] by how much the file's own numbers fall there"
    bits = 2 ** round(math.log2(size))
    counts = bits if abs(size / bits - 1.0) < TURN else round(size)
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
