"""Put one effect in the place of another: what it contains, what contains it, and what it is mistaken for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from firmloop.diagnose.model.candidate import (
    Candidate,
    contain,
    containing,
    larger,
    rated,
    related,
    richer,
    rms_of,
    without,
)
from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, evidence, fit, own_evidence
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, searched
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import (
    CLEAR_GAIN,
    EXCHANGE_PATIENCE,
    EXCHANGE_STARTS,
    EXCHANGE_TRIAL_PATIENCE,
    EXCHANGED_SHARE,
    HOPELESS_SHARE,
    MINOR_SHARE,
    RICHER_PRICE,
    STEPS_OF_A_NEAR_FIT,
    STEPS_OF_A_TRIAL,
    TIE,
)


def swapped(problem: Problem, best: Candidate, gain: float) -> tuple[Candidate, tuple[Candidate, ...]]:
    """Put what an effect is mistaken for in its place, one by one; return the best and all that was tried."""
    tried: list[Candidate] = []
    seen = {frozenset(term.label for term in best.fitted.terms)}
    begun = problem.engine.steps
    for gone, come in mistaken(problem, best.fitted):
        labels = frozenset(c.label for c in (*best.fitted.terms, come) if c != gone)
        if labels not in seen and problem.engine.steps - begun < EXCHANGE_PATIENCE:
            seen.add(labels)
            tried.append(_translated(problem, best, gone, come, HOPELESS_SHARE * gain))
    for winner in sorted(tried, key=lambda each: each.score):
        theirs, ours = set(winner.fitted.names), set(best.fitted.names)
        if contain(theirs - ours, ours):
            better = richer(winner, best, gain)
        elif contain(ours - theirs, theirs - ours):
            better = not richer(best, winner, gain)
        else:
            better = best.score - winner.score > TIE
        if better and not larger(winner, best):
            # What it is put in the place of may only have been further from its end.
            again = rated(
                problem,
                fit(problem, problem.train, best.fitted.terms, best.fitted.point, winner.noises, STEPS_OF_A_NEAR_FIT),
            )
            if again.score < winner.score:
                return again, tuple(sorted((best, *tried), key=lambda each: each.score))
            return winner, (best, *tried)
    return best, tuple(sorted(tried, key=lambda each: each.score))


def mistaken(problem: Problem, best: Fitted) -> list[tuple[LibraryTerm, LibraryTerm]]:
    """Return each term of the best with what it may be mistaken for, first what is most likely for each."""
    found: list[tuple[int, LibraryTerm, LibraryTerm]] = []
    for gone in best.terms:
        names = (*gone.effect.confusable_with, *related(gone.effect.name))
        for come in problem.terms:
            if come not in best.terms and come.effect.name in names:
                found.append((names.index(come.effect.name), gone, come))
            elif come not in best.terms and gone.effect.name in come.effect.confusable_with:
                found.append((len(names), gone, come))
    return [(gone, come) for _, gone, come in sorted(found, key=lambda each: each[0])]


def tied(rounds: Sequence[Sequence[Candidate]], best: Fitted) -> list[tuple[LibraryTerm, LibraryTerm]]:
    """Return each term of the best with what explained as much in its place, beside other terms, when it was found."""
    found: list[tuple[LibraryTerm, LibraryTerm]] = []
    for candidates in rounds:
        for one, other in permutations(candidates, 2):
            mine, theirs = set(one.fitted.terms), set(other.fitted.terms)
            if abs(one.score - other.score) < TIE and len(mine - theirs) == len(theirs - mine) == 1:
                gone, come = (mine - theirs).pop(), (theirs - mine).pop()
                if gone in best.terms and come not in best.terms and (gone, come) not in found:
                    found.append((gone, come))
    return found


def retied(problem: Problem, best: Candidate, rounds: Sequence[Sequence[Candidate]]) -> tuple[Candidate, ...]:
    """Fit beside the best what tied with one of its effects, as far as that has not been tried there."""
    known = [set(each.fitted.terms) for candidates in rounds for each in candidates]
    return tuple(
        _translated(problem, best, gone, come)
        for gone, come in tied(rounds, best.fitted)
        if {*best.fitted.terms, come} - {gone} not in known
    )


def twins(problem: Problem, best: Candidate, rounds: Sequence[Sequence[Candidate]]) -> tuple[Candidate, ...]:
    """Fit what an effect is mistaken for in its place, beside the best and all that ties with it.

    What ties with a twin of the best is as likely as that: a load for an offset, a friction for the load. What has a
    moment of its own is no twin, and what was tried before is not tried again.
    """
    known = {frozenset(each.fitted.terms) for candidates in rounds for each in candidates}
    found = [best, *(each for candidates in rounds for each in candidates)]
    first, begun = len(found), problem.engine.steps
    for each in found:  # which grows
        if len(each.fitted.terms) != len(best.fitted.terms) or abs(each.score - best.score) >= TIE:
            continue
        for gone, come in mistaken(problem, each.fitted):
            terms = frozenset({*each.fitted.terms, come} - {gone})
            new = terms not in known and not searched(come)
            if new and problem.engine.steps - begun < EXCHANGE_PATIENCE:
                known.add(terms)
                found.append(_translated(problem, each, gone, come, CLEAR_GAIN))
    return tuple(found[first:])


def amounting(problem: Problem, best: Candidate, gain: float) -> Candidate:
    """Put the simpler effect in the place of one whose values amount to it; `gain` is what all effects have brought."""
    allowed = max(RICHER_PRICE, EXCHANGED_SHARE * gain)
    return next((one for one in plainer(problem, best) if one.score - best.score < allowed), best)


def plainer(problem: Problem, best: Candidate) -> Iterator[Candidate]:
    """Fit the simpler effect, by the noises of the best, in the place of each one whose values amount to it."""
    for gone in best.fitted.terms:
        come = problem.term(amounts_to(best.fitted, gone))
        if come is not None and come not in best.fitted.terms:
            yield _translated(problem, best, gone, come)


def amounts_to(fitted: Fitted, term: LibraryTerm) -> str:
    """Name the simpler effect that a term with its values amounts to; blank for none."""
    if term.effect.becomes is None:
        return ""
    return term.effect.becomes([fitted.point.values[key] for key in term.keys], term.scales)


def merged(problem: Problem, best: Candidate, gain: float) -> Candidate:
    """Put one effect in the place of those whose sum it is, where that explains as much."""
    for come in problem.terms:
        parts = {name: shares for name, shares in come.effect.sum_of}
        gone = [term for term in best.fitted.terms if term.effect.name in parts]
        if not parts or len(gone) < len(parts):
            continue
        values = best.fitted.point.values
        sums = np.sum([np.multiply(parts[each.effect.name], values[each.keys[0]]) for each in gone], axis=0)
        start = {
            key: min(max(float(value), each.low), each.high)
            for key, value, each in zip(come.keys, sums, come.parameters, strict=True)
        }
        kept, rest = without(best.fitted, *gone)
        begin = Point(entered(rest.values, come, start), rest.starts)
        one = rated(problem, fit(problem, problem.train, (*kept, come), begin, best.noises, STEPS_OF_A_NEAR_FIT))
        if one.score - best.score < max(TIE, MINOR_SHARE * gain):
            return one
    return best


def parted(problem: Problem, best: Candidate, gain: float) -> Candidate:
    """Put the parts of a sum in its place, one of them as a richer effect, where those explain clearly more.

    A load beside a friction that falls with speed is at first a friction of two sizes, and then a drag beside it.
    """
    found = [best]
    for gone in best.fitted.terms:
        names, shares = zip(*gone.effect.sum_of, strict=True) if gone.effect.sum_of else ((), ())
        parts = [each for each in map(problem.term, names) if each is not None and each not in best.fitted.terms]
        if not parts or len(parts) < len(names):
            continue
        values = [best.fitted.point.values[key] for key in gone.keys]
        sizes = np.linalg.lstsq(np.transpose(shares), values, rcond=None)[0]
        kept, rest = without(best.fitted, gone)
        whole = {**rest.values, **{each.keys[0]: float(size) for each, size in zip(parts, sizes, strict=True)}}
        same = replace(best.fitted, terms=(*kept, *parts), point=Point(whole, rest.starts))
        found += [
            _translated(problem, replace(best, fitted=same), part, come)
            for part in parts
            for come in problem.terms
            if come.effect.name in containing(part.effect.name) and come != gone and come not in kept
        ]
    winner = min(found, key=lambda each: each.score)
    return winner if richer(winner, best, gain) and not larger(winner, best) else best


def relatives(problem: Problem, candidate: Candidate, known: Collection[tuple[LibraryTerm, ...]]) -> list[Candidate]:
    """Fit what the newest effect contains and what contains it, but for `known` terms, from the values they share."""
    newest = candidate.fitted.terms[-1]
    names = related(newest.effect.name)
    kept = candidate.fitted.terms[:-1]
    return [
        _translated(problem, candidate, newest, term)
        for term in problem.terms
        if term.effect.name in names and term not in kept and (*kept, term) not in known
    ]


def alike(one: LibraryTerm, other: LibraryTerm) -> dict[str, str]:
    """Map parameters of the other to those of the first that have the same name.

    What contains an effect of one parameter has it as all its parameters of that unit.
    """
    mine = {each.name: key for key, each in zip(one.keys, one.parameters, strict=True)}
    alone = len(mine) == 1 and contain((other.effect.name,), (one.effect.name,))
    lone = len(other.keys) == 1 and contain((one.effect.name,), (other.effect.name,))
    found = {}
    for key, each in zip(other.keys, other.parameters, strict=True):
        if each.name in mine or ((alone or lone) and each.unit == one.parameters[0].unit):
            found[key] = mine.get(each.name, one.keys[0])
    return found


def exchanged(
    base: Fitted, gone: LibraryTerm, come: LibraryTerm, start: Mapping[str, float], held: bool = False
) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Put one term at its start in the place of another.

    The nominal inertia stays beside a load that both have, and in the place of one by which they are the same: too
    large to move, as it is taken to be if it is `held`. What the other contains gives way, too.
    """
    kept, rest = without(base, gone, *_contained(base, gone, come))
    values, before = dict(entered(rest.values, come, start)), base.point.values
    shared = gone.taken is not None and come.taken is not None and start[come.taken[0]] == before[gone.taken[0]]
    if gone.taken is not None and (held or shared or amounts_to(base, gone) == come.effect.name):
        values[gone.taken[1]] = before[gone.taken[1]]
    return (*kept, come), Point(values, rest.starts)


def _translated(
    problem: Problem, candidate: Candidate, gone: LibraryTerm, come: LibraryTerm, behind: float = np.inf
) -> Candidate:
    """Put one term in the place of another, and fit from the best of the starts of what they do not share.

    A trial that is too far `behind` in evidence is not fitted to the end.
    """
    values = candidate.fitted.point.values
    shared = {key: values[own] for key, own in alike(gone, come).items()}
    starts = [{**start, **shared} for start in problem.starts[come.label]]
    distinct = list({tuple(sorted(start.items())): start for start in starts}.values())[:EXCHANGE_STARTS]
    loses = gone.taken is not None and come.taken is None
    plain = SumOfSquares(problem, problem.train, (), candidate.noises, np.zeros((0, 1)))
    trials = []
    for start in distinct:
        ways = [exchanged(candidate.fitted, gone, come, start, held) for held in ((False, True) if loses else (False,))]
        begin = min(ways, key=lambda way: plain.at(way[1]).cost) if loses else ways[0]
        trials.append(fit(problem, problem.train, *begin, candidate.noises, STEPS_OF_A_TRIAL, EXCHANGE_TRIAL_PATIENCE))
    best = min(trials, key=lambda each: each.cost)
    if own_evidence(problem, best) - evidence(candidate.fitted, candidate.noises) > behind:
        return rated(problem, best)
    return rated(problem, fit(problem, problem.train, best.terms, best.point, candidate.noises, STEPS_OF_A_NEAR_FIT))


def _contained(base: Fitted, gone: LibraryTerm, come: LibraryTerm) -> list[LibraryTerm]:
    """Return the terms beside one that another, which comes in its place, has as special cases."""
    return [each for each in base.terms if each != gone and each.effect.name in come.effect.contains]


def slimmer(problem: Problem, fitted: Fitted, gone: LibraryTerm) -> Iterator[tuple[tuple[LibraryTerm, ...], Point]]:
    """Yield a hypothesis without a term, and with each special case of it in its place: that may be all that is sure.

    A friction may be certain, and how it begins to slide not.
    """
    yield without(fitted, gone)
    for come in problem.terms:
        case = come.effect.name in gone.effect.contains and (come.at, come.output) == (gone.at, gone.output)
        if case and come not in fitted.terms:
            start = as_large(problem, fitted, gone, come, problem.starts[come.label][0])
            if start is not None:
                yield exchanged(fitted, gone, come, start)


def as_large(
    problem: Problem, fitted: Fitted, gone: LibraryTerm, come: LibraryTerm, start: Mapping[str, float]
) -> Mapping[str, float] | None:
    """Return a start with its size scaled so that one term does most nearly what the other did.

    Where both are one function of the recordings a fit from there has nothing left to do. None where it would have to
    do the opposite, or does nothing.
    """
    _, bare = without(fitted, gone, *_contained(fitted, gone, come))
    _, point = exchanged(fitted, gone, come, start)
    weights = 1.0 / np.maximum(rms_of(fitted.residuals), 1e-300)
    size = share = 0.0
    for k, (each, left) in enumerate(zip(problem.train, fitted.residuals, strict=True)):
        before = residual_of(problem, each, bare, k)
        does = before - residual_of(problem, each, point, k)
        size += float(np.sum((weights * does) ** 2))
        share += float(np.sum(weights**2 * does * (before - left)))
    if not (np.isfinite(size) and size > 0.0 and share > 0.0):
        return None
    unit = come.parameters[0].unit if come.parameters else ""
    scaled = {key for key, each in zip(come.keys, come.parameters, strict=True) if each.unit == unit}
    return {key: value * share / size if key in scaled else value for key, value in start.items()}
