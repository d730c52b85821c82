"""Lead a fit past the kinks of contacts: where teeth meet a row earlier or later, its cost has a valley of its own.

A contact that is a little off moves all that follow it. On the first part of a recording there are few, and a fit that
is right there sees the next ones nearly where they are: so a stretch grows first, and its end is nudged then.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

from diagnose.hypothesis import Cause, Point, Scene, meeting
from diagnose.refit import Fitted, evidence, fit, noises_of, own_evidence
from identify.noise import Noise, flat
from identify.recording import Recording

_NUDGES = (  # factors on where a contact is, how stiff it is, and how damped: as much of critical as it was
    (1.0, 1.0, 1.0),
    (1.02, 1.0, 1.0),
    (0.98, 1.0, 1.0),
    (1.1, 1.0, 1.0),
    (0.9, 1.0, 1.0),
    (1.0, 0.5, math.sqrt(0.5)),
    (1.0, 2.0, math.sqrt(2.0)),
)
_STRETCHES = (0.05, 0.1, 0.2, 0.35, 0.55, 0.75)  # of the rows that a fit grows over before it takes all
_BRIEF = 0.2  # of the rows; fewer do not tell how stiff and how damped a contact is
_HARDER = (1.0, 3.0, 10.0)  # factors on how stiff contacts are, where a stretch begins to grow
_GROWTH = 6.0  # s of computing after which no stretch begins to grow
_LAST = 24  # steps of a fit to all rows
_STEPS = 12  # of a fit to some, and from a nudge
_WORTH = 2.0  # evidence that a nudge has to bring
_PATIENCE = 5.0  # s of computing


def past_contacts(scene: Scene, fitted: Fitted, noises: Sequence[Noise], patience: float = _PATIENCE) -> Fitted:
    """Move the contacts that causes make, a little at a time, as long as a fit from there explains more."""
    nudges = [nudge for factors in _NUDGES for nudge in _moved(fitted, factors)]
    if not nudges:
        return fitted
    told = own_evidence(scene, fitted)
    until = time.process_time() + patience
    moved = True
    while moved:
        moved = False
        for values in nudges:
            if time.process_time() > until:
                return fitted
            begin = _at(fitted, values)
            other = fit(scene, scene.train, fitted.causes, begin, noises, _STEPS)
            left = noises_of(scene, other.residuals)
            score = evidence(other, left)
            if told - score > _WORTH:
                fitted, told, noises, moved = other, score, left, True
                break
    return fitted


def _moved(fitted: Fitted, factors: Sequence[float]) -> list[dict[str, float]]:
    """Return the factors on where the contact of each cause that makes one is, how stiff and how damped, by key."""
    return [
        {
            key: factor
            for begins, factor in zip(cause.effect.contact, factors, strict=True)
            for key, each in zip(cause.keys, cause.parameters, strict=True)
            if each.name.startswith(begins)
        }
        for cause in fitted.causes
        if cause.effect.contact
    ]


def _at(fitted: Fitted, factors: Mapping[str, float]) -> Point:
    """Return the point of a fit with some of its values multiplied."""
    values = fitted.point.values
    return Point({**values, **{key: by * values[key] for key, by in factors.items()}}, fitted.point.starts)


def grown(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Fit again on stretches that grow, with contacts as stiff as they were and stiffer; return what explains most."""
    if not meeting(fitted.causes):
        return fitted
    until = time.process_time() + _GROWTH
    best, told = fitted, own_evidence(scene, fitted)
    for harder in _HARDER:
        factors = {key: by for each in _moved(fitted, (1.0, harder, math.sqrt(harder))) for key, by in each.items()}
        other = _over_stretches(scene, fitted.causes, _at(fitted, factors), noises)
        score = own_evidence(scene, other)
        gain = told - score
        if gain > _WORTH:
            best, told = other, score
        if (harder == 1.0 and not gain > 0.0) or time.process_time() > until:
            break
    return best


def _over_stretches(scene: Scene, causes: Sequence[Cause], point: Point, noises: Sequence[Noise]) -> Fitted:
    """Fit from a point to more and more rows; how contacts give way is left for later."""
    for share in _STRETCHES:
        part = replace(scene, train=tuple(_first(each, share) for each in scene.train), memory={})
        held = _giving(causes) if share < _BRIEF else ()
        first = fit(part, part.train, causes, point, flat(noises), _STEPS, held=held)
        point, noises = first.point, noises_of(part, first.residuals)
    return fit(scene, scene.train, causes, point, noises, _LAST)


def _giving(causes: Sequence[Cause]) -> list[str]:
    """Return the keys of how stiff and how damped contacts are."""
    return [
        key
        for cause in causes
        for key, each in zip(cause.keys, cause.parameters, strict=True)
        if each.name.startswith(cause.effect.contact[1:])
    ]


def _first(recording: Recording, share: float) -> Recording:
    """Return the first rows of a recording."""
    rows = max(int(share * len(recording.time)), 2)
    columns = {name: values[:rows] for name, values in recording.columns.items()}
    return replace(recording, time=recording.time[:rows], columns=columns)
