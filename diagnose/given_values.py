"""Ask whether a value that the project holds explains what an effect does, were it a little off.

A resistance that a data sheet has a tenth too low passes for a supply that sags, an inductance for a sensor's scale.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from firmloop.diagnose.completion import with_doubts
from firmloop.diagnose.finding import Finding
from firmloop.diagnose.model.candidate import Candidate, rated, without
from firmloop.diagnose.model.fit import deviations, ended, evidence, fit, own_evidence
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem
from firmloop.diagnose.model.profile_likelihood import profiled
from firmloop.diagnose.policy import CLEAR_GAIN, GIVEN_WITHIN, STEPS_OF_A_FIT, STEPS_OF_A_TRIAL, TIE
from firmloop.diagnose.search.found import Search
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.plant import Parameter


@dataclass(frozen=True, slots=True)
class HeldValue:
    """A value that the project holds, and that fitted explains as much as an effect, but not clearly more."""

    instead: LibraryTerm
    says: str


@dataclass(frozen=True, slots=True)
class _Freed:
    problem: Problem
    parameter: Parameter
    gone: LibraryTerm
    candidate: Candidate


def against_given(found: Search) -> tuple[Search, tuple[str, ...], HeldValue | None]:
    """Return the search with what explains clearly more than an effect in its place: a held value, fitted.

    With a note of each, and with one that explains as much as an effect, beside which that keeps its name.
    """
    notes: list[str] = []
    while found.best.fitted.terms:
        best = rated(found.problem, found.best.fitted)
        one = min(_freed(found.problem, best), key=lambda each: each.candidate.score, default=None)
        if one is None or one.candidate.score > best.score + TIE:
            break
        by = one.candidate.noises
        fitted = with_doubts(one.problem, profiled(one.problem, ended(one.problem, one.candidate.fitted, by), by))
        name, given, unit = one.parameter.name, one.parameter.value, one.parameter.unit
        value, reach = fitted.point.values[name], NORMAL_95 * deviations(fitted)[name]
        told = f"{name}, which the project holds at {given:.4g} {unit}, fitted is {value:.4g} ± {reach:.2g} {unit}"
        if best.score - one.candidate.score <= TIE:
            return found, tuple(notes), HeldValue(one.gone, f"{told}, and explains as much as {one.gone.label}")
        notes.append(f"{told}, and explains more than {one.gone.label}: set free = true, or check it")
        sure = replace(one.candidate, fitted=fitted)
        nominal = found.nominal if fitted.terms else sure
        found = replace(found, problem=one.problem, best=sure, nominal=nominal, rounds=(), gains=found.gains[:-1])
    return found, tuple(notes), None


def beside_held(finding: Finding, held: HeldValue | None) -> Finding:
    """Return the finding with a held value that explains as much as one of its effects beside that effect."""
    place = None if held is None else (held.instead.effect.name, held.instead.output)
    effect = next((each for each in finding.effects if (each.name, each.output) == place), None)
    if held is None or effect is None:
        return finding
    shared = replace(effect, probability=0.5 * effect.probability)
    effects = tuple(shared if each is effect else each for each in finding.effects)
    says = [shared.told() if line == effect.told() else line for line in finding.says]
    said = f"More than one explanation stands: {held.says}. Measure it, or set free = true."
    return replace(finding, verdict="ambiguous", effects=effects, says=(said, *says))


def _freed(problem: Problem, best: Candidate) -> Iterator[_Freed]:
    """Fit each value that is held in the place of each effect, where that comes near, and ends not far from it."""
    least = evidence(best.fitted, best.noises)
    for parameter in problem.plant.parameters:
        if parameter.free or not parameter.value:  # what is zero was never measured
            continue
        other = replace(problem, plant=problem.plant.freed(parameter.name))
        for gone in best.fitted.terms:
            one = fit(other, other.train, *without(best.fitted, gone), best.noises, STEPS_OF_A_TRIAL)
            if own_evidence(other, one) - least > CLEAR_GAIN:
                continue
            one = fit(other, other.train, one.terms, one.point, best.noises, STEPS_OF_A_FIT)
            ratio = one.point.values[parameter.name] / parameter.value
            if ratio > 0.0 and abs(math.log(ratio)) < GIVEN_WITHIN:
                yield _Freed(other, parameter, gone, rated(other, one))
