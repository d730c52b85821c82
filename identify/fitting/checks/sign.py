"""A reading that runs against what the plant as given does: a reversed encoder, shunt or drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, alike, compared, run_as_given

Array = NDArray[np.float64]

_AGAINST = -0.5  # correlation with the plant as given, which may be off by a factor of two in every parameter
_FOLLOWS = 0.8  # correlation with its magnitude
_SIGNLESS = 0.03  # of the largest reading: noise of one that has no sign


def look(evidence: Evidence) -> tuple[str, ...]:
    """Compare every output with the plant as given, over all recordings."""
    seen: list[list[tuple[Array, Array]]] = [[] for _ in evidence.given.outputs]
    for recording in evidence.recordings:
        run = run_as_given(evidence.given, recording)
        if run is None:
            return ()
        for pairs, pair in zip(seen, compared(evidence, recording, run), strict=True):
            pairs.append(pair)
    sources = ", ".join(dict.fromkeys(recording.source for recording in evidence.recordings))
    found = []
    for signal, pairs in zip(evidence.given.outputs, seen, strict=True):
        correlation, _ = alike(*(np.concatenate([pair[k] for pair in pairs]) for k in (0, 1)))
        if correlation < _AGAINST and not _has_no_sign(pairs):
            drive = evidence.given.inputs[0].name
            found.append(
                f"{signal.name} of {sources} runs against {drive} (correlation with the plant as given "
                f"{correlation:.2f}): turn the sign of the column or of {drive}, or of the parameter that carries it "
                "in [plant.parameters] if the plant is meant to answer so"
            )
    return tuple(found)


def _has_no_sign(pairs: Sequence[tuple[Array, Array]]) -> bool:
    """Tell whether a reading is a magnitude: never negative, where the plant goes both ways."""
    real, model = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    if np.min(real) < -_SIGNLESS * np.max(real):
        return False
    return bool(np.min(model) < 0.0 < np.max(model)) and alike(real, np.abs(model))[0] > _FOLLOWS


CHECK = Check("sign", look, ("scale", "motor_constants", "rest", "drift", "structure", "excitation"), False)
