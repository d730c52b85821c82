"""Lead a fit past the kinks of contacts: where teeth meet a row earlier or later, its cost has a valley of its own."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from diagnose.hypothesis import Point, Scene
from diagnose.refit import Fitted, evidence, fit, noises_of, own_evidence
from identify.noise import Noise

_NUDGES = (  # factors on where a contact is, how stiff it is, and how damped: as much of critical as it was
    (1.0, 1.0, 1.0),
    (1.02, 1.0, 1.0),
    (0.98, 1.0, 1.0),
    (1.1, 1.0, 1.0),
    (0.9, 1.0, 1.0),
    (1.0, 0.5, math.sqrt(0.5)),
    (1.0, 2.0, math.sqrt(2.0)),
)
_STEPS = 12  # of a fit from there
_WORTH = 2.0  # evidence that a nudge has to bring
_PATIENCE = 5.0  # s of computing


def past_contacts(scene: Scene, fitted: Fitted, noises: Sequence[Noise], patience: float = _PATIENCE) -> Fitted:
    """Move the contacts that causes make, a little at a time, as long as a fit from there explains more."""
    nudges = [
        {
            key: factor
            for begins, factor in zip(cause.effect.contact, factors, strict=True)
            for key, each in zip(cause.keys, cause.parameters, strict=True)
            if each.name.startswith(begins)
        }
        for cause in fitted.causes
        if cause.effect.contact
        for factors in _NUDGES
    ]
    until = time.process_time() + patience
    told = own_evidence(scene, fitted)
    moved = bool(nudges)
    while moved:
        moved = False
        for factors in nudges:
            if time.process_time() > until:
                return fitted
            values = fitted.point.values
            begin = Point({**values, **{key: by * values[key] for key, by in factors.items()}}, fitted.point.starts)
            other = fit(scene, scene.train, fitted.causes, begin, noises, _STEPS)
            left = noises_of(scene, other.residuals)
            score = evidence(other, left)
            if told - score > _WORTH:
                fitted, told, noises, moved = other, score, left, True
                break
    return fitted
