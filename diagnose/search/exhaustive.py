"""Before something is called unknown: try every term from all its starts, whatever a screen had promised."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from firmloop.diagnose.model.candidate import extended, larger, rated
from firmloop.diagnose.model.fit import Fitted, evidence, fit, noises_of, own_evidence
from firmloop.diagnose.model.hypothesis import first_point
from firmloop.diagnose.policy import (
    EXHAUSTIVE_FINALS,
    EXHAUSTIVE_PATIENCE,
    EXHAUSTIVE_SHARE,
    STEPS_OF_A_FIT,
    STEPS_OF_A_LAST_FIT,
    STEPS_OF_A_TRIAL,
    TIE,
)
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.screen import Screened, every_start
from firmloop.diagnose.search.stepwise import accepted
from firmloop.identify.fitting.noise import plain_too


def exhausted(found: Search) -> Search | None:
    """Return a search that begins with the one term that explains more than all of the best does; None if none."""
    problem, base = found.problem, found.nominal
    without = evidence(base.fitted, base.noises)
    worth = EXHAUSTIVE_SHARE * (without - evidence(found.best.fitted, found.best.noises))
    until = problem.engine.steps + EXHAUSTIVE_PATIENCE
    known = [each.term for each in found.screened]
    rest = [(term, problem.starts[term.label]) for term in problem.terms if term not in known]
    every = (*found.screened, *(Screened(term, 0.0, starts[0], 0.0) for term, starts in rest if starts))
    # A nominal plant that was refitted without an effect may no longer come to the place where it acts.
    bases = (base.fitted, replace(base.fitted, point=first_point(problem, problem.train)))
    told: dict[str, list[tuple[float, Fitted]]] = {}
    # Whitened edges are traps in which the search has looked already.
    for noises in reversed(plain_too(base.noises)):
        for each in every:
            from_bases = bases if each.term.effect.needs_position else bases[:1]
            for start, begun in product(every_start(problem, each), from_bases):
                if problem.engine.steps < until:
                    one = fit(problem, problem.train, *extended(begun, each.term, start), noises, STEPS_OF_A_TRIAL)
                    told.setdefault(each.term.label, []).append((own_evidence(problem, one), one))
    trials = [min(fits, key=lambda pair: pair[0]) for fits in told.values()]
    trials.sort(key=lambda pair: pair[0])
    candidates = []
    for trial in [each for score, each in trials if without - score > worth][:EXHAUSTIVE_FINALS]:
        longer = fit(
            problem, problem.train, trial.terms, trial.point, noises_of(problem, trial.residuals), STEPS_OF_A_FIT
        )
        ended = fit(
            problem, problem.train, trial.terms, longer.point, noises_of(problem, longer.residuals), STEPS_OF_A_LAST_FIT
        )
        candidates.append(rated(problem, ended))
    best = min(candidates, key=lambda each: each.score, default=base)
    if found.best.score - best.score < TIE or larger(best, base):
        return None
    rounds = (*found.rounds, tuple(sorted(candidates, key=lambda each: each.score)))
    best = accepted(problem, best)
    return replace(found, best=best, rounds=rounds, gains=(base.score - best.score,))
