"""One round of a search: refit the most promising terms beside what was found, the best of them to the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from firmloop.diagnose.model.candidate import Candidate, extended, larger, rated, related
from firmloop.diagnose.model.continuation import met, past_contacts
from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, evidence, fit, noises_of, own_evidence
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, turning
from firmloop.diagnose.model.kinks import limits
from firmloop.diagnose.policy import (
    CLEAR_GAIN,
    CONTACT_FIT_PATIENCE,
    CONTACT_STARTS,
    FINALS_OF_A_ROUND,
    HALVINGS,
    IMPOSSIBLE,
    INSISTING_PATIENCE,
    LARGEST_SIZE,
    PROMISED_IN_A_ROUND,
    PROMISED_SHARE,
    ROUND_PATIENCE,
    STEPS_OF_A_FIT,
    STEPS_OF_A_LAST_FIT,
    STEPS_OF_A_START,
    STEPS_OF_A_TRIAL,
    THRESHOLD,
    TRIED_IN_A_ROUND,
)
from firmloop.diagnose.search.exchange import relatives
from firmloop.diagnose.search.from_given import afresh, runaways
from firmloop.diagnose.search.orders import best_orders
from firmloop.diagnose.search.screen import Screened, every_start, ground, screen
from firmloop.identify.fitting.noise import Noise, colored, flat, white


def screened(problem: Problem, best: Candidate) -> tuple[Screened, ...]:
    """Screen with the colored noise of what is left and with white noise: what is left may itself be the effect."""
    found = best.fitted.terms
    special = {name for term in found for name in term.effect.contains}  # cases of what is there already
    open_terms = [each for each in problem.terms if each not in found and each.effect.name not in special]
    under = [best.noises, flat(best.noises)] if colored(best.noises) else [best.noises]
    grounds = [ground(problem, problem.train, best.fitted, noises) for noises in under]
    orders = best_orders(problem, best.fitted, grounds)
    tables = screen(problem, problem.train, best.fitted, open_terms, grounds, orders)
    shaped, plain = ({each.term.label: each for each in table} for table in (tables[0], tables[-1]))
    scale = max((each.gain for each in plain.values()), default=1.0) / max(
        max((each.gain for each in shaped.values()), default=1.0), 1.0
    )
    labels = sorted({*shaped, *plain})  # a term may show under one noise model alone
    merged = [max((shaped.get(label), _scaled(plain.get(label), scale)), key=_gain) for label in labels]
    drops = {label: max(each.drop for each in (shaped.get(label), plain.get(label)) if each) for label in labels}
    raised = [replace(each, gain=max(each.gain, drops[each.term.label])) for each in merged if each is not None]
    return tuple(sorted(raised, key=lambda each: -each.gain))


def _scaled(screened: Screened | None, scale: float) -> Screened | None:
    return None if screened is None else replace(screened, gain=screened.gain / max(scale, 1e-12))


def _gain(screened: Screened | None) -> float:
    return -1.0 if screened is None else screened.gain


def promising(screened: Sequence[Screened], worth: float) -> Sequence[Screened]:
    """Return the terms that are worth a refit, of those screened, best first."""
    top = screened[0].gain if screened else 0.0
    return [each for each in screened[:TRIED_IN_A_ROUND] if each.gain > max(worth, PROMISED_SHARE * top)]


def tried_beside(
    problem: Problem, best: Candidate, screened: Sequence[Screened], others: Sequence[Fitted], worth: float
) -> tuple[Candidate, ...]:
    """Refit the most promising terms and their relatives; the best are refitted to the end."""
    picked = promising(screened, worth)
    trials = _trials(problem, best, screened, picked, others)
    without = evidence(best.fitted, best.noises)
    if trials and without - trials[0][0] < CLEAR_GAIN:
        trials = sorted([*trials, *_insisted(problem, best, picked)], key=lambda pair: pair[0])
    if not trials:
        return ()
    final = _chosen(trials, picked, without)
    noises = noises_of(problem, final[0].residuals)
    longer = [fit(problem, problem.train, each.terms, each.point, noises, STEPS_OF_A_FIT) for each in final]
    told = [own_evidence(problem, each) for each in longer]
    longer = [
        _met(problem, each, noises) if score - min(told) < CLEAR_GAIN else each
        for each, score in zip(longer, told, strict=True)
    ]
    noises = noises_of(problem, min(longer, key=lambda each: each.cost).residuals)
    ended = [fit(problem, problem.train, each.terms, each.point, noises, STEPS_OF_A_LAST_FIT) for each in longer]
    candidates = [rated(problem, each) for each in ended if not _too_large(each)]
    if not candidates:
        return ()
    candidates = [each for each in candidates if not larger(each, best)] or candidates
    best_one = min(candidates, key=lambda each: each.score)
    while kin := relatives(problem, best_one, {each.fitted.terms for each in candidates if _ended(each, best_one)}):
        candidates = [*candidates, *kin]
        nearest = min(candidates, key=lambda each: each.score)
        if nearest is best_one:
            break
        best_one = nearest
    return tuple(sorted(candidates, key=lambda each: each.score))


def _ended(candidate: Candidate, best: Candidate) -> bool:
    """Tell whether a fit has come to an end: what has the best as a special case is no worse than it where it has."""
    rich = best.fitted.terms[-1].effect.name in candidate.fitted.terms[-1].effect.contains
    return candidate.score <= best.score if rich else candidate.score < IMPOSSIBLE


def _met(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Lead a fit past its contacts; where those are new, on a stretch that grows first."""
    return (met if fitted.terms[-1].effect.contact else past_contacts)(problem, fitted, noises, CONTACT_FIT_PATIENCE)


def _trials(
    problem: Problem,
    best: Candidate,
    screened: Sequence[Screened],
    picked: Sequence[Screened],
    others: Sequence[Fitted],
) -> list[tuple[float, Fitted]]:
    """Fit what was picked and its relatives in a few steps; return all trials with their evidence, best first."""
    kin = {other for each in picked for other in related(each.term.effect.name)}
    blind = not best.fitted.terms  # beside other effects, what no screen sees would be tried in every round
    more = [
        each
        for each in screened
        if each not in picked and (each.term.effect.name in kin or (blind and not each.term.effect.screened))
    ]
    found = [*reversed(others)]
    begun = problem.engine.steps
    away = bool(best.fitted.terms) and bool(runaways(problem, best.fitted))
    for each in [*picked, *more]:
        if found and problem.engine.steps - begun > ROUND_PATIENCE:
            break
        meeting = bool(each.term.effect.contact) and each in picked  # bodies: every start has a valley of its own
        every = problem.starts[each.term.label] if meeting else _starts(problem, each)
        begins = [extended(best.fitted, each.term, start) for start in every]
        if away:
            begins.append(afresh(problem, best.fitted, each))
        begins += _sized(problem, best, *begins[0])
        fits = [fit(problem, problem.train, terms, begin, best.noises, STEPS_OF_A_TRIAL) for terms, begin in begins]
        if meeting:
            first = sorted(fits, key=lambda one: one.cost)[:CONTACT_STARTS]
            fits = [
                fit(problem, problem.train, one.terms, one.point, best.noises, STEPS_OF_A_FIT // 2) for one in first
            ]
        found += [fitted for fitted in fits if not _too_large(fitted)]
    told = [(own_evidence(problem, each), each) for each in found]
    return sorted(told, key=lambda pair: pair[0])


def _insisted(problem: Problem, best: Candidate, picked: Sequence[Screened]) -> list[tuple[float, Fitted]]:
    """Follow what promised much as if all noise were white: whitened edges are traps.

    From all its starts for a few steps, and to the end from where those come nearest (successive halving).
    """
    sizes = [white(noise.scale) for noise in best.noises]
    found = []
    begun = problem.engine.steps
    for each in [each for each in picked[:PROMISED_IN_A_ROUND] if each.gain > THRESHOLD]:
        if problem.engine.steps - begun > INSISTING_PATIENCE:
            break
        begins = [extended(best.fitted, each.term, start) for start in _each_start(problem, each)]
        trials = [fit(problem, problem.train, *begin, sizes, STEPS_OF_A_START) for begin in begins]
        near = min(trials, key=lambda fitted: fitted.cost)
        fitted = fit(problem, problem.train, near.terms, near.point, sizes, STEPS_OF_A_FIT)
        if not _too_large(fitted):
            found.append((own_evidence(problem, fitted), fitted))
    return found


def _sized(
    problem: Problem, best: Candidate, terms: tuple[LibraryTerm, ...], begin: Point
) -> list[tuple[tuple[LibraryTerm, ...], Point]]:
    """Return a beginning with a new wave halved until it leaves less than there is without; none where it does at once.

    What a screen tells of its size is of the first order, and past its own crests a wave leads anywhere.
    """
    if not turning(terms[-1:]):
        return []
    size, plain = terms[-1].keys[0], SumOfSquares(problem, problem.train, (), best.noises, np.zeros((0, 1)))
    without = plain.at(best.fitted.point).cost
    for half in range(HALVINGS):
        point = Point({**begin.values, size: 0.5**half * begin.values[size]}, begin.starts)
        if plain.at(point).cost < without:
            return [(terms, point)] if half else []
    return []


def _each_start(problem: Problem, screened: Screened) -> list[Mapping[str, float]]:
    """Return all starts of a term, first the one that promises most."""
    every = every_start(problem, screened)
    return [screened.start, *(start for start in every if dict(start) != dict(screened.start))]


def _chosen(trials: Sequence[tuple[float, Fitted]], picked: Sequence[Screened], without: float) -> list[Fitted]:
    """Return one fit of each of the best hypotheses, and of what promised most: of more where no trial gains.

    Of the best limit a second one: a higher one beside a larger gain may do the same on train, and not elsewhere.
    `without` is the evidence that there is without any.
    """
    final: list[Fitted] = []
    for score, fitted in trials:
        near = len(final) < 2 or score - trials[0][0] < CLEAR_GAIN
        if near and len(final) < FINALS_OF_A_ROUND and all(fitted.terms != other.terms for other in final):
            final.append(fitted)
    for each in picked[: PROMISED_IN_A_ROUND if trials[0][0] > without else 1]:
        promised = next((fitted for _, fitted in trials if fitted.terms[-1] == each.term), None)
        if promised is not None and all(promised.terms != other.terms for other in final):
            final.append(promised)
    second = (
        fitted
        for score, fitted in trials
        if score - trials[0][0] < CLEAR_GAIN
        and limits(fitted.terms[-1:])
        and any(one.terms == fitted.terms and one is not fitted for one in final)
    )
    return [*final, *islice(second, 1)]


def _too_large(fitted: Fitted) -> bool:
    """Tell whether the newest effect had to be as large as it can be: it only stands for another."""
    newest = fitted.terms[-1]
    sizes = zip(newest.keys[:1], newest.parameters[:1], strict=True)
    bounded = [(key, each.high) for key, each in sizes if each.default is None and np.isfinite(each.neutral)]
    return any(fitted.point.values[key] > LARGEST_SIZE * high for key, high in bounded)


def _starts(problem: Problem, screened: Screened) -> list[Mapping[str, float]]:
    """Return the start that promises most, for effects of three parameters a second one, and for limits all.

    A limit that is set too low bends all else on its way up.
    """
    term = screened.term
    others = [dict(start) for start in problem.starts[term.label] if dict(start) != dict(screened.start)]
    if limits([term]):
        return [screened.start, *others]
    return [screened.start, *others[len(others) // 2 :][:1]] if len(term.keys) >= 3 else [screened.start]
