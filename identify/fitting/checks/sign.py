"""A reading that runs against what the plant as given does: a reversed encoder, shunt or drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, alike, compared, runs_as_given, sources_of

Array = NDArray[np.float64]

_ALONE = -0.8  # correlation of one recording beside others that follow
_AGAINST = -0.5  # correlation with the plant as given, which may be off by a factor of two in every parameter
_FOLLOWS = 0.8  # correlation with its magnitude
_OF_A_SIZE = 0.6  # correlation of a magnitude with the plant driven by one: it lags where the drive turns around
_BETTER = 0.3  # by which that is more than of the reading itself
_SIGNLESS = 0.03  # of the largest reading: noise of one that has no sign


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare every output with the plant as given, over all recordings."""
    seen: list[list[tuple[Array, Array]]] = [[] for _ in evidence.given.outputs]
    runs = runs_as_given(evidence)
    if runs is None:
        return ()
    for recording, run in zip(evidence.recordings, runs, strict=True):
        for pairs, pair in zip(seen, compared(evidence, recording, run), strict=True):
            pairs.append(pair)
    joined = [tuple(np.concatenate([pair[k] for pair in pairs]) for k in (0, 1)) for pairs in seen]
    if one_way := _driven_one_way(evidence, joined):
        return (one_way,)
    drive, sources = " or ".join(each.name for each in evidence.given.inputs), sources_of(evidence.recordings)
    found = []
    for signal, pairs, (real, model) in zip(evidence.given.outputs, seen, joined, strict=True):
        correlation, _ = alike(real, model)
        alone = [alike(*pair)[0] for pair in pairs]
        against = [recording for recording, each in zip(evidence.recordings, alone, strict=True) if each < _ALONE]
        if _has_no_sign(real, model) and correlation < _FOLLOWS:
            found.append(
                f"{signal.name} of {sources} is never negative, though the plant goes both ways "
                f'as given: a reading without a sign; write [[plant.effects]] with name = "sensor_rectified" and '
                f'output = "{signal.name}", or record the direction, too'
            )
        elif correlation < _AGAINST:
            found.append(
                f"{signal.name} of {sources} runs against {drive} (correlation with the plant as "
                f"given {correlation:.2f}): turn the sign of the column or of {drive}, or of the parameter that "
                "carries it in [plant.parameters] if the plant is meant to answer so"
            )
        elif against and max(alone) > _FOLLOWS:
            found.append(
                f"{signal.name} of {sources_of(against)} runs against {drive}, and that of other recordings does not: "
                "turn the sign of that column in the file, or leave the file out"
            )
    return tuple(found)


def _driven_one_way(evidence: Evidence, joined: Sequence[tuple[Array, ...]]) -> str:
    """Say that a drive is never negative, though an output goes both ways and its size follows; blank else."""
    if len(evidence.given.inputs) != 1:
        return ""
    drive = evidence.given.inputs[0].name
    values = np.concatenate([recording.columns[drive] for recording in evidence.recordings])
    if np.min(values) < -_SIGNLESS * np.max(values):
        return ""
    for signal, (real, model) in zip(evidence.given.outputs, joined, strict=True):
        both = min(-np.min(real), np.max(real)) > _SIGNLESS * np.max(np.abs(real))
        size = alike(np.abs(real), np.abs(model))[0]
        if both and size > _OF_A_SIZE and size - alike(real, model)[0] > _BETTER:
            return (
                f"{drive} of {sources_of(evidence.recordings)} is never negative, though {signal.name} goes both "
                "ways and its size follows: a drive or a duty recorded without its direction; record the direction, "
                f"too, and give {drive} its sign"
            )
    return ""


def _has_no_sign(real: Array, model: Array) -> bool:
    """Tell whether a reading is like a magnitude: never negative, where the plant goes both ways."""
    if np.min(real) < -_SIGNLESS * np.max(real):
        return False
    top = _SIGNLESS * float(np.max(np.abs(model)))
    both = bool(np.min(model) < -top and np.max(model) > top)
    return both and alike(real, np.abs(model))[0] > _FOLLOWS


CHECK = Check("sign", look, ("scale", "motor_constants", "early", "rest", "drift", "structure", "excitation"), False)
