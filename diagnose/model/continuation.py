"""Lead a fit past the kinks of contacts: where teeth meet a row earlier or later, its cost has a valley of its own.

A contact that is a little off moves all that follow it. On the first part of a recording there are few, and a fit that
is right there sees the next ones nearly where they are: so a stretch grows first, and its end is nudged then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from firmloop.diagnose.model.fit import Fitted, evidence, fit, noises_of, own_evidence
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, meeting
from firmloop.diagnose.policy import (
    BRIEF_CONTACT,
    CONTACT_FIT_PATIENCE,
    CONTACT_NUDGES,
    CONTACT_STRETCHES,
    GROWTH_PATIENCE,
    HARDER_CONTACTS,
    NUDGE_GAIN,
    STEPS_OF_A_FIT,
    STEPS_OF_A_NEAR_FIT,
)
from firmloop.identify.fitting.noise import Noise, flat
from firmloop.identify.recordings.recording import Recording


def met(problem: Problem, fitted: Fitted, noises: Sequence[Noise], patience: float) -> Fitted:
    """Let a fit grow over the rows, and lead it past the kinks that are left."""
    fitted = grown(problem, fitted, noises)
    return past_contacts(problem, fitted, noises_of(problem, fitted.residuals), patience)


def past_contacts(
    problem: Problem, fitted: Fitted, noises: Sequence[Noise], patience: float = CONTACT_FIT_PATIENCE
) -> Fitted:
    """Move the contacts that terms make, a little at a time, as long as a fit from there explains more."""
    if not meeting(fitted.terms):
        return fitted
    told = own_evidence(problem, fitted)
    until = problem.engine.steps + patience
    moved = True
    while moved:
        moved = False
        for factors in CONTACT_NUDGES:
            if problem.engine.steps > until:
                return fitted
            other = fit(problem, problem.train, fitted.terms, _nudged(fitted, factors), noises, STEPS_OF_A_NEAR_FIT)
            left = noises_of(problem, other.residuals)
            score = evidence(other, left)
            if told - score > NUDGE_GAIN:
                fitted, told, noises, moved = other, score, left, True
                break
    return fitted


def grown(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Fit again on stretches that grow, with contacts as stiff as they were and stiffer; return what explains most."""
    if not meeting(fitted.terms):
        return fitted
    until = problem.engine.steps + GROWTH_PATIENCE
    best, told = fitted, own_evidence(problem, fitted)
    for harder in HARDER_CONTACTS:
        begin = _nudged(fitted, (1.0, harder, math.sqrt(harder)))
        other = over_stretches(problem, fitted.terms, begin, noises)
        score = own_evidence(problem, other)
        gain = told - score
        if gain > NUDGE_GAIN:
            best, told = other, score
        if (harder == 1.0 and not gain > 0.0) or problem.engine.steps > until:
            break
    return best


def _contacts(terms: Sequence[LibraryTerm]) -> dict[str, int]:
    """Return what each key of a contact says: 0 where it is, 1 how stiff, 2 how damped."""
    return {
        key: which
        for term in terms
        for which, begins in enumerate(term.effect.contact)
        for key, each in zip(term.keys, term.parameters, strict=True)
        if each.name.startswith(begins)
    }


def _nudged(fitted: Fitted, factors: Sequence[float]) -> Point:
    """Return the point of a fit with factors on where contacts are, how stiff and how damped."""
    values = fitted.point.values
    moved = {key: factors[which] * values[key] for key, which in _contacts(fitted.terms).items()}
    return Point({**values, **moved}, fitted.point.starts)


def over_stretches(problem: Problem, terms: Sequence[LibraryTerm], point: Point, noises: Sequence[Noise]) -> Fitted:
    """Fit from a point to more and more rows; how contacts give way is left for later."""
    giving = [key for key, which in _contacts(terms).items() if which > 0]
    for share in CONTACT_STRETCHES:
        part = replace(problem, train=tuple(_first(each, share) for each in problem.train), memory={})
        held = giving if share < BRIEF_CONTACT else ()
        first = fit(part, part.train, terms, point, flat(noises), STEPS_OF_A_NEAR_FIT, held=held)
        point, noises = first.point, noises_of(part, first.residuals)
    return fit(problem, problem.train, terms, point, noises, STEPS_OF_A_FIT)


def _first(recording: Recording, share: float) -> Recording:
    """Return the first rows of a recording."""
    return recording.part(0, max(int(share * len(recording.time)), 2))
