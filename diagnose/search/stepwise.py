"""Search for what explains the recordings: grow by screened terms, refit in full, prune, and rank the candidates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.quantization import coarse
from firmloop.diagnose.model.angle import follows_record, lost, lost_count, strayed
from firmloop.diagnose.model.batch_means import accidental, by_chance, times_chance
from firmloop.diagnose.model.candidate import (
    Candidate,
    by_simulation_error,
    closer,
    creeps,
    faint,
    larger,
    rated,
    relieved,
    simplest,
    worth_their_price,
)
from firmloop.diagnose.model.continuation import over_stretches, past_contacts
from firmloop.diagnose.model.fit import Fitted, evidence, fit, noises_of
from firmloop.diagnose.model.hypothesis import (
    MOMENT,
    Point,
    Problem,
    meeting,
    rescaled,
    turning,
)
from firmloop.diagnose.model.slopes import residual_of, whitened
from firmloop.diagnose.policy import (
    COLORED_THRESHOLD,
    EXCHANGES,
    LONG_MEMORY,
    MINOR_SHARE,
    MOST_EFFECTS,
    NEEDED_RMS,
    NEVER_BY_CHANCE,
    NOISE_GAIN,
    SEARCH_PATIENCE,
    SEARCHED_PRICE,
    SLOW_THRESHOLD,
    STEPPED_LIMIT_THRESHOLD,
    STEPS_OF_A_FIT,
    THRESHOLD,
    TIE,
    WORTH_A_REFIT,
)
from firmloop.diagnose.search.exchange import amounting, merged, parted, retied, swapped
from firmloop.diagnose.search.found import Hypothesis, Progress, Search, beside, near_best
from firmloop.diagnose.search.from_given import (
    from_balance,
    from_given,
    from_means,
    nominal_fit,
    runaways,
    with_likelier,
)
from firmloop.diagnose.search.harmless import as_identified
from firmloop.diagnose.search.round import promising, screened, tried_beside
from firmloop.diagnose.search.screen import Screened
from firmloop.identify.fitting.noise import Noise, colored, flat, white
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import LONGEST_CHANGE

Array = NDArray[np.float64]

_SOUGHT = (MOMENT, ".periods_per_rev", ".periods_per_m")


def search(problem: Problem, progress: Progress, most: int = MOST_EFFECTS, refit: Plant | None = None) -> Search:
    """Explain the train recordings of a problem by at most so many effects; `refit` is theirs, where it is known."""
    progress(0.05, "refitting the nominal plant")
    refit = refit or as_identified(problem.plant, problem.train)
    nominal = nominal_fit(problem, refit)
    if runaways(problem, nominal.fitted):
        problem = rescaled(problem, nominal.fitted.point.values)
    best = nominal
    problem.engine.follow(follows_record(problem, nominal))
    problem.engine.lose(lost(problem, nominal))
    rounds: list[tuple[Candidate, ...]] = []
    gains: list[float] = []
    first: tuple[Screened, ...] = ()
    barren = frozenset[Hypothesis]()
    begun = problem.engine.steps
    for turn in range(most):
        if turn and problem.engine.steps - begun > SEARCH_PATIENCE:
            break
        progress(0.15 + 0.2 * turn, f"looking for effect {turn + 1}")
        # Where noise alone is left, no term gains more than it promises; where not, a soaked one hides another.
        whole = not colored(best.noises)
        worth = max(WORTH_A_REFIT, 0.5 * MINOR_SHARE * sum(gains)) if whole else WORTH_A_REFIT
        chosen, nearest = None, best
        for begin in filter(None, (best, best.likelier)):  # what the nearest fit misses may be what drifts
            table = screened(problem, begin)
            first = first or table
            others = _begun_elsewhere(problem, best, table) if begin is best else ()
            barren = beside(best, promising(table, worth))
            candidates = tried_beside(problem, begin, table, others, worth)
            if not candidates:
                continue
            if best.score > candidates[0].score:  # what it won may be that the others were further from their end
                nearest = with_likelier((best, _gone_on(problem, best.fitted, candidates[0].noises)))
            rounds.append(candidates)
            chosen = _chosen(problem, candidates, nearest, worth, sum(gains))
            if chosen is not None:
                break
        if chosen is None:
            best = nearest
            break
        without = _without(nearest, chosen)
        gains.append(without - chosen.score)
        best, barren = accepted(problem, chosen), frozenset()
        if turn == 0:
            nominal = replace(nearest, score=without)
    if not gains:
        return Search(problem, best, best, tuple(rounds), first, (), refit, barren)
    before = set(best.fitted.terms)
    best, tried = _settled(problem, _displaced(problem, best, rounds[-1]), gains)
    made = Search(problem, nominal, best, (*rounds, tried), first, tuple(gains), refit, barren)
    if set(best.fitted.terms) - before and len(best.fitted.terms) < most:
        return further(made) or made  # what was mistaken for it had hidden the rest
    return made


def _begun_elsewhere(problem: Problem, best: Candidate, table: Sequence[Screened]) -> tuple[Fitted, ...]:
    return (*from_given(problem, best, table), *from_means(problem, best), *from_balance(problem, best))


def further(found: Search, table: Sequence[Screened] | None = None) -> Search | None:
    """Look for one more effect, however little beside what the others explain; None where there is none.

    `table` are the terms as screened, best first; None screens them. What was tried beside the best is not tried again.
    """
    problem, nearest = found.problem, found.best
    table = screened(problem, nearest) if table is None else table
    if beside(nearest, promising(table, WORTH_A_REFIT)) <= found.barren:
        return None
    candidates = tried_beside(problem, nearest, table, (), WORTH_A_REFIT)
    if not candidates:
        return None
    chosen = _chosen(problem, candidates, nearest, WORTH_A_REFIT, 0.0)
    if chosen is None:
        return None
    without = _without(nearest, chosen)
    gains = (*found.gains, without - chosen.score)
    best, tried = _settled(problem, _refollowed(problem, _unwhitened(problem, chosen)), gains)
    nominal = found.nominal if found.gains else replace(nearest, score=without)
    return replace(found, nominal=nominal, best=best, rounds=(*found.rounds, candidates, tried), gains=gains)


def accepted(problem: Problem, chosen: Candidate) -> Candidate:
    """Lead an explanation out of traps, let it follow the better angle, and take finer steps where it asks for them."""
    return _refined(problem, _refollowed(problem, _unwhitened(problem, chosen)))


def settled(found: Search) -> Search:
    """Drop what is not needed of the best, and put what is mistaken for an effect in its place."""
    best, tried = _settled(found.problem, found.best, found.gains)
    return replace(found, best=best, rounds=(*found.rounds, tried))


def levelled(found: Search) -> Search:
    """Polish the candidates near the best as that was, with what had tied with a part of it: they may be as good."""
    problem, best = found.problem, found.best
    near = near_best(found).values()
    every = sorted((best, *(_unwhitened(problem, each) for each in near)), key=lambda each: each.score)
    every += retied(problem, every[0], (*found.rounds, every))
    likeliest = min(worth_their_price(every), key=lambda each: each.score)
    return replace(found, best=likeliest, rounds=(*found.rounds, tuple(every)))


def _settled(problem: Problem, best: Candidate, gains: Sequence[float]) -> tuple[Candidate, tuple[Candidate, ...]]:
    """Drop what is not needed, and put what is mistaken for an effect in its place; the best and all that was tried."""
    tried: tuple[Candidate, ...] = ()
    for _ in range(EXCHANGES):
        slim = pruned(problem, best)
        best, more = swapped(problem, slim, sum(gains))
        tried += more
        best = parted(problem, best, sum(gains))
        if best.fitted.terms == slim.fitted.terms:
            break
    else:
        best = pruned(problem, best)
    return merged(problem, amounting(problem, best, sum(gains)), sum(gains)), tried


def _displaced(problem: Problem, best: Candidate, beside_it: Sequence[Candidate]) -> Candidate:
    """Return what explains more by no more effects: one tried beside the best that leaves another nothing to do.

    It had not begun from where that other, which was found first, has put the nominal parameters.
    """
    for each in beside_it:
        if best.score > each.score and set(each.fitted.terms) > set(best.fitted.terms):
            slim = pruned(problem, each)
            new = set(slim.fitted.terms) - set(best.fitted.terms)
            as_few = len(slim.fitted.terms) <= len(best.fitted.terms)
            if new and as_few and best.score - slim.score > TIE and not larger(slim, best):
                return accepted(problem, slim)
    return best


def _refollowed(problem: Problem, candidate: Candidate) -> Candidate:
    """Let waves follow the angle that explains most: as they did, the recorded one amended anew, or the simulated one.

    Another one only where it explains clearly more. A simulated one has lost count behind the first wave that it passes
    and the machine did not: a fit grows over the rows to it.
    """
    engine = problem.engine
    if not turning(candidate.fitted.terms):
        engine.amend(strayed(problem, candidate))
        return candidate
    best, held = candidate, (engine.recorded, engine.strayed)
    amended = candidate
    for recorded, again in ((True, False), (True, True), (False, False)):
        off = strayed(problem, amended) if recorded else engine.strayed
        if (again or recorded == held[0]) and not off:
            continue
        engine.follow(recorded)
        engine.amend(off)
        begun, noises = amended.fitted, amended.noises
        if not recorded:
            begun = over_stretches(problem, begun.terms, begun.point, noises)
        other = _unwhitened(problem, _gone_on(problem, begun, noises))
        if recorded:
            amended = other
        if best.score - other.score > TIE:
            best, held = other, (recorded, off)
    engine.follow(held[0])
    engine.amend(held[1])
    return best


def _gone_on(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Candidate:
    return rated(problem, fit(problem, problem.train, fitted.terms, fitted.point, noises, STEPS_OF_A_FIT))


def _refined(problem: Problem, candidate: Candidate) -> Candidate:
    """Go on by finer steps where the coarse ones leave a trace beside little noise: the next effect would take it."""
    engine, fitted = problem.engine, candidate.fitted
    if engine.longest_change <= LONGEST_CHANGE:
        return candidate
    coarse = engine.longest_change
    engine.hasten(LONGEST_CHANGE)
    finer = [residual_of(problem, recording, fitted.point, k) for k, recording in enumerate(problem.train)]
    pairs = zip(finer, fitted.residuals, strict=True)
    if sum(float(np.sum(whitened(one - other, candidate.noises) ** 2)) for one, other in pairs) > TIE:
        return _gone_on(problem, fitted, candidate.noises)
    engine.hasten(coarse)
    return candidate


def _unwhitened(problem: Problem, candidate: Candidate) -> Candidate:
    """Fit once more as if all noise were white innovations, and then with what that leaves, if that explains more.

    Whitened residuals show edges, where a wrong moment is a trap. Plain ones show the slow course, and most that of the
    slowest output, which leads out. A nominal parameter that ran away in such a trap begins where it was given.
    """
    fitted = candidate.fitted
    given = runaways(problem, fitted)
    found = [candidate]
    if given or colored(candidate.noises):
        sizes = [white(noise.scale) for noise in candidate.noises]
        plain = fit(problem, problem.train, fitted.terms, fitted.point, sizes, STEPS_OF_A_FIT)
        noises, last = noises_of(problem, plain.residuals), math.inf
        while (size := sum(math.log(noise.rms) for noise in noises)) < last - NOISE_GAIN:
            last = size  # it had ended in a valley that went on
            plain = fit(problem, problem.train, fitted.terms, plain.point, flat(noises), STEPS_OF_A_FIT)
            noises = noises_of(problem, plain.residuals)
        begin = Point({**plain.point.values, **given}, plain.point.starts)
        found.append(rated(problem, fit(problem, problem.train, fitted.terms, begin, noises, STEPS_OF_A_FIT)))
    return min((each for each in found if not larger(each, candidate)), key=lambda each: each.score)


def _chosen(
    problem: Problem, candidates: Sequence[Candidate], nearest: Candidate, worth: float, known: float
) -> Candidate | None:
    """Return the best explanation that brings what it must; None where none does.

    If the best does not, one that comes far closer in simulations may; or it is held against its like, a fit without
    that is likelier and farther off than the nearest. `known` is the drop of BIC by all effects before: of what it is
    far larger than a trace may be left.
    """
    best = simplest(candidates, nearest.score)
    for each in (best, *(each for each in candidates if each is not best and closer(each, nearest))):
        led = _nearer(problem, each, nearest)
        led = _accompanied(problem, led, nearest, worth) if larger(led, nearest) else led
        trace = nearest.score - led.score < MINOR_SHARE * known and not closer(led, nearest)
        if not trace and _earned(problem, led, nearest) and not lost_count(problem, led, nearest):
            return led
    like = nearest.likelier
    if like is not None and _earned(problem, best, like) and not lost_count(problem, best, like):
        return best
    return None


def _without(nearest: Candidate, chosen: Candidate) -> float:
    """Return the score that an explanation is held against: the likeliest without, if it is likelier than that."""
    return nearest.likeliest.score if chosen.score < nearest.likeliest.score else nearest.score


def _nearer(problem: Problem, candidate: Candidate, base: Candidate) -> Candidate:
    """Lead an explanation that only whitens what is left back to where simulations come closer, if that is as good."""
    if not larger(candidate, base) or candidate.score >= base.score:
        return candidate
    return rated(problem, by_simulation_error(problem, candidate.fitted))


def _accompanied(problem: Problem, candidate: Candidate, base: Candidate, worth: float) -> Candidate:
    """Return an explanation that only whitens what is left with the effect beside it, after which it comes nearer.

    Of two effects one may hide what the other does: a load makes simulations drift away that a slew rate made right.
    As it was where neither is worth its name, or it is none.
    """
    if not _pays(problem, candidate, base) or len(candidate.fitted.terms) >= MOST_EFFECTS:
        return candidate
    candidates = tried_beside(problem, candidate, screened(problem, candidate), (), worth)
    if not candidates:
        return candidate
    both = simplest(candidates, candidate.score)
    return both if _earned(problem, both, candidate) and not larger(both, base) else candidate


def _earned(problem: Problem, candidate: Candidate, base: Candidate) -> bool:
    """Tell whether the newest effect brings what it must, on train too, and comes no further from every output."""
    return not larger(candidate, base) and _pays(problem, candidate, base)


def _pays(problem: Problem, candidate: Candidate, base: Candidate) -> bool:
    """Tell whether the newest effect brings what it must, on train too, beside the likeliest fit without it."""
    gain = base.likeliest.score - candidate.score
    return gain >= _bar(problem, candidate, base, gain) and not faint(problem, candidate, base)


def _bar(problem: Problem, candidate: Candidate, base: Candidate, gain: float) -> float:
    """Return the drop of BIC the newest effect must bring: more where a slow disturbance could be all it is.

    Of an effect that lasts batches tell that, where simulations come nearer, and where they come far nearer batches
    alone; `gain` is what it did bring.
    """
    newest, values = candidate.fitted.terms[-1], candidate.fitted.point.values
    least = THRESHOLD
    if any(len(noise.coefficients) >= LONG_MEMORY for noise in candidate.noises):
        least = SLOW_THRESHOLD if creeps(newest, values) else COLORED_THRESHOLD
        times = times_chance(problem, candidate.fitted, candidate.noises, newest)
        if accidental(newest, times, gain):
            return np.inf
        certain = NEVER_BY_CHANCE < times < np.inf
        if closer(candidate, base):  # what lasts hardly shows in innovations, whose noise a constant may be
            least = -np.inf if certain else THRESHOLD
        elif certain and any(mine.rms < theirs.rms for mine, theirs in zip(candidate.noises, base.noises, strict=True)):
            least = THRESHOLD
    sizes = [noise.rms for noise in candidate.noises]
    if newest.effect.limits and newest.output in {each.output for each in coarse(problem.plant, problem.train, sizes)}:
        least = STEPPED_LIMIT_THRESHOLD
    return least + (SEARCHED_PRICE if any(key.endswith(_SOUGHT) for key in newest.keys) else 0.0)


def pruned(problem: Problem, best: Candidate) -> Candidate:
    """Drop effects one by one as long as the rest explains as much, and no output is missed by far more."""
    while len(best.fitted.terms) > 1:
        begins = [relieved(problem, best.fitted, term, best.noises) for term in best.fitted.terms]
        slimmer = [rated(problem, fit(problem, problem.train, *each, best.noises, STEPS_OF_A_FIT)) for each in begins]
        least = min(slimmer, key=lambda each: each.score)
        spared = _spared(problem, best, least)
        if not spared and meeting(least.fitted.terms):
            least = rated(problem, past_contacts(problem, least.fitted, least.noises))
            spared = _spared(problem, best, least)
        if not spared:
            return best
        best = least
    return best


def _spared(problem: Problem, best: Candidate, slim: Candidate) -> bool:
    """Tell whether the best can do without what a slimmer one has not, which may be the average of a disturbance.

    Unseen recordings only confirm what brings something on train, too.
    """
    if any(one.rms > NEEDED_RMS * other.rms for one, other in zip(slim.noises, best.noises, strict=True)):
        return False
    lost, gone = slim.score - best.score, set(best.fitted.terms) - set(slim.fitted.terms)
    silent = evidence(slim.fitted, slim.noises) < evidence(best.fitted, best.noises)
    return silent or lost < THRESHOLD or by_chance(problem, best.fitted, best.noises, gone, lost)
