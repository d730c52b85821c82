"""Lead a fit past the kinks of contacts: where teeth meet a row earlier or later, its cost has a valley of its own."""

from __future__ import annotations

import time
from collections.abc import Sequence

from diagnose.hypothesis import Point, Scene
from diagnose.refit import Fitted, evidence, fit, noises_of, own_evidence
from identify.noise import Noise

_NUDGES = (1.1, 0.9)  # factors on where a contact is
_STEPS = 12  # of a fit from there
_WORTH = 2.0  # evidence that a nudge has to bring
_PATIENCE = 5.0  # s of computing


def past_contacts(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Move the contact that the newest cause makes, a tenth at a time, as long as a fit from there explains more."""
    newest = fitted.causes[-1]
    if not newest.effect.contact:
        return fitted
    (key,) = (
        key
        for key, each in zip(newest.keys, newest.parameters, strict=True)
        if each.name.startswith(newest.effect.contact)
    )
    until = time.process_time() + _PATIENCE
    told = own_evidence(scene, fitted)
    moved = True
    while moved:
        moved = False
        for factor in _NUDGES:
            if time.process_time() > until:
                return fitted
            begin = Point({**fitted.point.values, key: factor * fitted.point.values[key]}, fitted.point.starts)
            other = fit(scene, scene.train, fitted.causes, begin, noises, _STEPS)
            left = noises_of(scene, other.residuals)
            score = evidence(other, left)
            if told - score > _WORTH:
                fitted, told, noises, moved = other, score, left, True
                break
    return fitted
