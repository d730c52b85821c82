"""Go on searching as long as what is left moves slowly or has a shape: a large effect must not hide a small one."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

from firmloop.diagnose.discrepancy.disturbance import rivals_noise
from firmloop.diagnose.discrepancy.fit import Shape, best_shape, outweighs, weighed
from firmloop.diagnose.model.batch_means import with_disturbances
from firmloop.diagnose.model.candidate import Candidate, closer, rated, without
from firmloop.diagnose.model.continuation import met
from firmloop.diagnose.model.disturbed_plant import driven_evidence
from firmloop.diagnose.model.fit import Fitted, ended, fit, noises_of, own_evidence, past_kinks
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem, meeting, turning
from firmloop.diagnose.model.kinks import limits, polished
from firmloop.diagnose.model.profile_likelihood import profiled
from firmloop.diagnose.model.sandwich_covariance import doubtful
from firmloop.diagnose.model.scale_doubt import with_doubt_of_given
from firmloop.diagnose.policy import (
    CHANCE_GAIN,
    COMPLETION_PATIENCE,
    CURVED_VALLEYS,
    KINK_SOLVES,
    LEFT_GAIN,
    LITTLE_GAIN,
    MOST_EFFECTS,
    PATCHED_GAIN,
    STEPS_OF_A_FIT,
    STEPS_OF_A_NEAR_FIT,
    THRESHOLD,
    TIE,
    TRACE_SHARE,
    WIDER_RMS,
)
from firmloop.diagnose.search.anew import by_simulation, floated, in_pieces
from firmloop.diagnose.search.at_rest import rested
from firmloop.diagnose.search.exchange import slimmer
from firmloop.diagnose.search.exhaustive import exhausted
from firmloop.diagnose.search.found import Progress, Search
from firmloop.diagnose.search.late_sensor import retimed
from firmloop.diagnose.search.simulation_error import independent, nearer, nearest, needed, strays, unlike_noise
from firmloop.diagnose.search.stepwise import further, levelled, pruned, settled
from firmloop.identify.fitting.noise import colored, flat
from firmloop.identify.simulation.course import LONGEST_CHANGE


def completed(found: Search, progress: Progress) -> tuple[Search, Shape | None]:
    """Return the search that is believed, with what slow misfits and shapes still show, and the shape that is left."""
    begun = found.problem.engine.steps
    progress(0.75, "looking for what has no name")
    shape = best_shape(found, found.best)
    while (
        shape is not None
        and shape.gain > LEFT_GAIN
        and len(found.best.fitted.terms) < MOST_EFFECTS
        and found.problem.engine.steps - begun < COMPLETION_PATIENCE
    ):
        more = further(found, weighed(found))
        rest = None if more is None else best_shape(more, more.best)
        if more is None or (rest is not None and rest.gain > shape.gain):
            break
        found, shape = more, rest
    if unlike_noise(found.problem, found.best) and (other := floated(found)) is not None:
        found = _resumed(other)
        shape = best_shape(found, found.best)
    alone = _alone(found)
    shaped = outweighs(shape, found.best.noises, found.nominal.score - found.best.score)
    stuck = strays(found) or alone is not None or shaped or (not found.best.fitted.terms and rivals_noise(found))
    tried, spent = None, found.problem.engine.steps
    other = by_simulation(found, progress) if alone is None else None
    begun += found.problem.engine.steps - spent  # that search has its own patience
    if other is None and stuck:
        other, tried = exhausted(found) or in_pieces(found, progress), found
    if other is not None:
        found = other if other.problem.samples else _resumed(other)
        shape, alone = best_shape(found, found.best), _alone(found)
    if alone is not None:
        fewer = _fewer(found)
        if fewer is None:
            return replace(found, best=found.nominal), alone
        found, shape = fewer, None
    whole = rested(levelled(retimed(found)))
    sure = _confirmed(whole)
    instead, changed = None, set(sure.best.fitted.terms) != set(found.best.fitted.terms)
    if changed and found.problem.engine.steps - begun < COMPLETION_PATIENCE:
        instead = _instead_of(set(whole.best.fitted.terms) - set(sure.best.fitted.terms), sure)
    if instead is not None:
        sure = _confirmed(rested(levelled(instead)))
        shape = best_shape(sure, sure.best)
    if doubtful(sure.best.fitted, sure.best.noises) is not None:
        other = exhausted(found) if found is not tried else None  # it would end as before
        if other is not None:
            found = _resumed(other)
            sure, shape = _confirmed(rested(levelled(found))), best_shape(found, found.best)
        elif _may_be_chance(sure):
            alone = best_shape(found, found.nominal)
            explained = found.nominal.score - sure.best.score
            if alone is not None and alone.gain > explained + LEFT_GAIN:
                shape = alone  # else no law that holds the same load is sure, either
            return replace(found, best=found.nominal), shape
    if _random_force(sure):
        return replace(found, best=found.nominal), shape
    return sure, shape


def begun_anew(found: Search, progress: Progress) -> tuple[Search, Shape | None] | None:
    """Return what a search by simulation error alone finds from the nominal plant, and its shape; None if nothing.

    To be asked where what innovations have found does not hold: a model of noise has made noise of the motion.
    """
    other = by_simulation(replace(found, best=found.nominal, rounds=(), gains=()), progress)
    if other is None:
        return None
    sure = _confirmed(rested(levelled(retimed(other if other.problem.samples else _resumed(other)))))
    return None if _alone(sure) is not None else (sure, best_shape(sure, sure.best))


def _may_be_chance(found: Search) -> bool:
    """Tell whether the one effect of the best, which is doubtful, may be no more than a slow disturbance.

    What lasts soaks up what drifts; of all else simulations tell, where they come far nearer.
    """
    best, nominal = found.best, found.nominal
    if len(best.fitted.terms) != 1 or nominal.score - best.score >= CHANCE_GAIN:
        return False
    return best.fitted.terms[0].effect.lasting or not closer(best, nominal)


def _random_force(found: Search) -> bool:
    """Tell whether what the best explains may be what a random force beside the input does by chance.

    Asked of what pulls by where the machine is: that the force has moved there. Of what lasts its batches tell.
    """
    best, nominal = found.best, found.nominal
    terms = best.fitted.terms
    by_place = all((each.effect.slow and not each.effect.lasting) or turning([each]) for each in terms)
    if not terms or not by_place or nominal.score - best.score >= CHANCE_GAIN:
        return False
    return driven_evidence(found.problem, nominal.fitted) - driven_evidence(found.problem, best.fitted) < THRESHOLD


def _instead_of(gone: Set[LibraryTerm], found: Search) -> Search | None:
    """Return the search gone on with once its best is another, which the last had hidden more beside; None if nothing.

    Terms that are gone, of which nothing was certain, are not tried again.
    """
    if len(found.best.fitted.terms) == MOST_EFFECTS or not found.best.fitted.terms:
        return None
    problem = replace(found.problem, terms=tuple(each for each in found.problem.terms if each not in gone))
    rounds = tuple(tuple(each for each in turn if not gone & set(each.fitted.terms)) for turn in found.rounds)
    more = further(replace(found, problem=problem, best=rated(problem, found.best.fitted), rounds=rounds))
    return more and replace(more, problem=found.problem)


def _resumed(found: Search) -> Search:
    """Return the search gone on with until no effect is found beside it, and settled."""
    begun, gone_on = found.problem.engine.steps, None
    while len(found.best.fitted.terms) < MOST_EFFECTS and found.problem.engine.steps - begun < COMPLETION_PATIENCE:
        more = further(found)
        if more is None:
            break
        found = gone_on = more
    return gone_on or settled(found)


def _alone(found: Search) -> Shape | None:
    """Return the one shape that says more than several names; None where there is none.

    Or far more than one name, where that says little.
    """
    best, nominal = found.best, found.nominal
    explained = nominal.score - best.score
    least = 0.0 if len(best.fitted.terms) > 1 else LEFT_GAIN + explained
    if not best.fitted.terms or (least > LEFT_GAIN and explained > LITTLE_GAIN):
        return None
    shape = best_shape(found, nominal)
    return shape if shape is not None and shape.gain > explained + least else None


def _fewer(found: Search) -> Search | None:
    """Return the search with the fewest effects as its best that leave no shape; None where fewer leave one."""
    for count in range(1, len(found.best.fitted.terms)):
        some = [each for turn in found.rounds for each in turn if len(each.fitted.terms) == count]
        best = min(some, key=lambda each: each.score, default=found.nominal)
        if best.score < found.nominal.score:
            shape = best_shape(found, best)
            if shape is None or shape.gain < LEFT_GAIN:
                return replace(found, best=best)
    return None


def _confirmed(found: Search) -> Search:
    """Fit the best once more by finer steps and with the noise it leaves, so that its intervals are its own.

    The score stays that of the search, by which candidates were compared; but an effect that only stood for how far the
    others were from their best goes.
    """
    problem, best = found.problem, found.best
    if not best.fitted.terms:
        return found
    problem.engine.hasten(LONGEST_CHANGE)
    finer = _finer(problem, best)
    if len(best.fitted.terms) > 1:
        whole = rated(problem, finer)
        slim = pruned(problem, whole) if abs(best.score - whole.score) > TIE else whole
        slim = _past_kinks(problem, slim, max(PATCHED_GAIN, TRACE_SHARE * (found.nominal.score - best.score)))
        if slim is not whole:
            finer = _finer(problem, slim)
    finer = _certain(problem, with_doubts(problem, finer))
    return replace(found, best=replace(best, fitted=finer, noises=noises_of(problem, finer.residuals)))


def _certain(problem: Problem, fitted: Fitted) -> Fitted:
    """Drop effects of which a slow disturbance leaves nothing certain, as long as simulations without come as near."""
    noises, plain = noises_of(problem, fitted.residuals), not colored(fitted.noises)
    while len(fitted.terms) > 1 and (least := doubtful(fitted, noises)) is not None:
        # Whitened edges are traps.
        plainly = [
            past_kinks(problem, fit(problem, problem.train, *each, flat(noises), STEPS_OF_A_FIT))
            for each in slimmer(problem, fitted, least)
        ]
        slim = nearest(fitted, plainly)
        if needed(fitted, slim, least):
            break
        noises = noises_of(problem, slim.residuals)
        by = independent(slim.residuals) if plain else noises
        refit = fit(problem, problem.train, slim.terms, slim.point, by, STEPS_OF_A_NEAR_FIT)
        if nearer(slim, refit, 1.0 / WIDER_RMS):  # it has made noise of the motion
            refit, by = slim, independent(slim.residuals)
        fitted = with_doubts(problem, profiled(problem, ended(problem, refit, by), by))
    return fitted


def with_doubts(problem: Problem, fitted: Fitted) -> Fitted:
    """Widen the deviations to what slow disturbances leave of them, and what no noise model tells of."""
    return with_doubt_of_given(problem, with_disturbances(problem, fitted))


def _past_kinks(problem: Problem, candidate: Candidate, owed: float) -> Candidate:
    """Drop effects that only make up for the kinks at which a fit of the others had ended.

    `owed` is the drop of BIC that an effect may owe to them.
    """
    for term in candidate.fitted.terms:
        terms, point = without(candidate.fitted, term)
        if not _kinked(terms, candidate):
            continue
        slim = fit(problem, problem.train, terms, point, candidate.noises, STEPS_OF_A_NEAR_FIT)
        if rated(problem, slim).score - candidate.score < owed:
            one = rated(problem, polished(problem, slim, candidate.noises, KINK_SOLVES))
            candidate = one if one.score - candidate.score < THRESHOLD else candidate
    return candidate


def _kinked(terms: Sequence[LibraryTerm], candidate: Candidate) -> bool:
    """Tell whether plain squared error, which tells all where noise is white, has the kinks of limits."""
    return bool(limits(terms)) and not colored(candidate.noises)


def _met(problem: Problem, candidate: Candidate) -> Fitted:
    """Lead a fit past the kinks of contacts, where there are any, by finer steps."""
    if not meeting(candidate.fitted.terms):
        return candidate.fitted
    return met(problem, ended(problem, candidate.fitted, candidate.noises), candidate.noises, COMPLETION_PATIENCE)


def _finer(problem: Problem, candidate: Candidate) -> Fitted:
    """Take a fit to its end; past the kinks of limits, where noise is white and plain squared error tells all."""
    fitted, noises = _met(problem, candidate), candidate.noises
    if fitted is not candidate.fitted:
        noises = noises_of(problem, fitted.residuals)
    if _kinked(fitted.terms, candidate):
        fitted = polished(problem, fitted, noises, KINK_SOLVES)
    fitted = fit(problem, problem.train, fitted.terms, fitted.point, noises, 0)
    for _ in range(CURVED_VALLEYS):
        further_on = fit(problem, problem.train, fitted.terms, fitted.point, noises, STEPS_OF_A_FIT)
        if fitted.cost - further_on.cost < 1.0:
            break
        fitted = further_on
    begun = fit(problem, problem.train, candidate.fitted.terms, candidate.fitted.point, candidate.noises, 0)
    if own_evidence(problem, begun) + TIE < own_evidence(problem, fitted):  # its noise was not that of where it ended
        fitted, noises = begun, candidate.noises
    return profiled(problem, ended(problem, fitted, noises), noises)
