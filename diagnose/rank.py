"""Search for what explains the recordings: grow by screened causes, refit in full, prune, and rank the rivals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.angle import follows_record, lost_count, strayed
from firmloop.diagnose.contact import past_contacts
from firmloop.diagnose.descent import whitened
from firmloop.diagnose.direct import coarse
from firmloop.diagnose.given import from_given, runaways
from firmloop.diagnose.hypothesis import MOMENT, Cause, Point, Scene, first_point, meeting, turning
from firmloop.diagnose.lasting import accidental, by_chance, times_chance
from firmloop.diagnose.refit import evidence, fit, noises_of
from firmloop.diagnose.rival import (
    MINOR,
    TIE,
    Rival,
    closer,
    contain,
    creeps,
    faint,
    farther,
    larger,
    rated,
    relieved,
    simplest,
    tells,
)
from firmloop.diagnose.round import LONG, SHORT, screened, tried_beside
from firmloop.diagnose.screen import Screened
from firmloop.diagnose.swap import amounting, amounts_to, merged, parted, swapped
from firmloop.identify.fitting.noise import colored, flat, white
from firmloop.identify.simulation.course import LONGEST_CHANGE

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

THRESHOLD = 28.0  # drop of BIC below which nothing is said; bench/diagnose/nulls.py measures the rate of false alarms
COLORED_THRESHOLD = 60.0  # the same where there is a slow disturbance
SLOW_THRESHOLD = 80.0  # and there for effects that look like one
_STEPPED = 500.0  # the same of a limit of a sensor of coarse steps: the last of them looks like one
_SEARCHED = 8.0  # more where a parameter was searched over dozens of values: twice the logarithm of how many
_SOUGHT = (MOMENT, ".periods_per_rev", ".periods_per_m")
LONG_MEMORY = 6  # order of a noise model from which a disturbance is slow
MOST_EFFECTS = 4
_SURE = 8.0  # deviations by batches, more than which no slow disturbance has
_SWAPS = 3  # times that what is mistaken for an effect is put in its place
_FAR_MORE = 1.5  # ratio of residual rms, from which an effect is needed whatever innovations say
_NEAR, _LEVELLED = 3.0 * TIE, 3  # BIC from the best, and how many rivals, that are polished as that was
_NEARER = 0.02  # of the rms of what is left, by which a fit goes on that takes all noise as white
_WORTH = 12.0  # screened drop of the whitened sum of squares from which a refit is worth its time
_PATIENCE = 180.0  # million steps of simulation after which no further effect is looked for
_LONGER = 240.0  # the same beside bodies that meet, whose fits take far longer
_SPREAD = (1.0, 1.6, 0.6)  # factors on the nominal parameters from which the first fit starts


@dataclass(frozen=True, slots=True)
class Search:
    """What the search found: the nominal refit, the best explanation, and what it was chosen against, by round."""

    scene: Scene
    nominal: Rival
    best: Rival
    rounds: tuple[tuple[Rival, ...], ...]  # best first
    screened: tuple[Screened, ...]  # of the first round
    gains: tuple[float, ...]  # drop of BIC by each accepted effect, in the order found


def search(scene: Scene, progress: Progress) -> Search:
    """Explain the train recordings of a scene; tests only count when explanations are ranked."""
    progress(0.05, "refitting the nominal plant")
    nominal = _nominal(scene)
    best = nominal
    scene.engine.follow(follows_record(scene, nominal))
    rounds: list[tuple[Rival, ...]] = []
    gains: list[float] = []
    first: tuple[Screened, ...] = ()
    begun = scene.engine.steps
    for turn in range(MOST_EFFECTS):
        patience = _LONGER if meeting(best.fitted.causes) else _PATIENCE
        if turn and scene.engine.steps - begun > patience:
            break
        progress(0.15 + 0.2 * turn, f"looking for effect {turn + 1}")
        table = screened(scene, best)
        first = first or table
        # Where noise alone is left, no cause gains more than it promises; where not, a soaked one hides another.
        whole = not colored(best.noises)
        worth = max(_WORTH, 0.5 * MINOR * sum(gains)) if whole else _WORTH
        rivals = tried_beside(scene, best, table, from_given(scene, best), worth)
        if not rivals:
            break
        base = best
        if best.score > rivals[0].score:  # what it won may be that the others were further from their end
            again = fit(scene, scene.train, best.fitted.causes, best.fitted.point, rivals[0].noises, LONG)
            further_on = rated(scene, again)
            base = best if farther(further_on, best) else min((further_on, best), key=lambda each: each.score)
        chosen = _nearer(scene, simplest(rivals, base.score), base)
        rounds.append(rivals)
        if larger(chosen, base):
            chosen = _accompanied(scene, chosen, base, worth)
        gain = base.score - chosen.score
        trace = gain < MINOR * sum(gains) and not closer(scene, chosen, base)
        if trace or not _earned(scene, chosen, base) or lost_count(scene, chosen, base):
            best = base
            break
        gains.append(gain)
        best = accepted(scene, chosen)
        if turn == 0:
            nominal = base
    if not gains:
        return Search(scene, best, best, tuple(rounds), first, ())
    before = set(best.fitted.causes)
    best, tried = _settled(scene, best, gains)
    found = Search(scene, nominal, best, (*rounds, tried), first, tuple(gains))
    if set(best.fitted.causes) - before and len(best.fitted.causes) < MOST_EFFECTS:
        return further(found) or found  # what was mistaken for it had hidden the rest
    return found


def further(found: Search, table: Sequence[Screened] | None = None) -> Search | None:
    """Look for one more effect, however little beside what the others explain; None where there is none.

    `table` are the causes as screened, best first; None screens them.
    """
    scene, base = found.scene, found.best
    rivals = tried_beside(scene, base, screened(scene, base) if table is None else table, (), _WORTH)
    if not rivals:
        return None
    chosen = _nearer(scene, simplest(rivals, base.score), base)
    if not _earned(scene, chosen, base) or lost_count(scene, chosen, base):
        return None
    gains = (*found.gains, base.score - chosen.score)
    best, tried = _settled(scene, _refollowed(scene, _unwhitened(scene, chosen)), gains)
    nominal = found.nominal if found.gains else base
    return replace(found, nominal=nominal, best=best, rounds=(*found.rounds, rivals, tried), gains=gains)


def accepted(scene: Scene, chosen: Rival) -> Rival:
    """Lead an explanation out of traps, let it follow the better angle, and take finer steps where it asks for them."""
    return _refined(scene, _refollowed(scene, _unwhitened(scene, chosen)))


def settled(found: Search) -> Search:
    """Drop what is not needed of the best, and put what is mistaken for an effect in its place."""
    best, tried = _settled(found.scene, found.best, found.gains)
    return replace(found, best=best, rounds=(*found.rounds, tried))


def levelled(found: Search) -> Search:
    """Polish the rivals that are near the best as that was: they may be as good."""
    scene, best = found.scene, found.best
    near: dict[frozenset[Cause], Rival] = {}
    for each in rivals_of(found):
        if each.score - best.score < _NEAR and len(near) < _LEVELLED:
            near.setdefault(frozenset(each.fitted.causes), each)
    polished = sorted((_unwhitened(scene, each) for each in near.values()), key=lambda each: each.score)
    if not polished:
        return found
    if polished[0].score >= best.score:
        return replace(found, rounds=(*found.rounds, tuple(polished)))
    return replace(found, best=polished[0], rounds=(*found.rounds, (best, *polished)))


def rivals_of(search: Search) -> tuple[Rival, ...]:
    """Return other explanations with as many effects; one that only contains or is contained is no rival."""
    return tuple(
        rival for rival, theirs, ours in _others(search) if not (contain(theirs, ours) or contain(ours, theirs))
    )


def richer_of(search: Search) -> tuple[Rival, ...]:
    """Return the explanations with as many effects that have the best as a special case."""
    return tuple(rival for rival, theirs, ours in _others(search) if contain(theirs, ours))


def _others(search: Search) -> list[tuple[Rival, set[str], set[str]]]:
    """Return the explanations with as many effects, best first, with what only they have and what only the best has.

    Not those that amount to a simpler one.
    """
    mine = search.best.fitted
    every = sorted((each for turn in search.rounds for each in turn), key=lambda each: each.score)
    return [
        (each, set(each.fitted.names) - set(mine.names), set(mine.names) - set(each.fitted.names))
        for each in every
        if len(each.fitted.causes) == len(mine.causes)
        and set(each.fitted.causes) != set(mine.causes)
        and not any(amounts_to(each.fitted, cause) for cause in each.fitted.causes)
    ]


def _settled(scene: Scene, best: Rival, gains: Sequence[float]) -> tuple[Rival, tuple[Rival, ...]]:
    """Drop what is not needed, and put what is mistaken for an effect in its place; the best and all that was tried."""
    tried: tuple[Rival, ...] = ()
    for _ in range(_SWAPS):
        slim = pruned(scene, best)
        best, more = swapped(scene, slim, sum(gains))
        tried += more
        best = parted(scene, best, sum(gains))
        if best.fitted.causes == slim.fitted.causes:
            break
    else:
        best = pruned(scene, best)
    return merged(scene, amounting(scene, best, sum(gains)), sum(gains)), tried


def _refollowed(scene: Scene, rival: Rival) -> Rival:
    """Let waves follow the angle that explains most: as they did, the recorded one amended anew, or the simulated one.

    Another one only where it explains clearly more.
    """
    engine = scene.engine
    if not turning(rival.fitted.causes):
        engine.amend(strayed(scene, rival))
        return rival
    best, held = rival, (engine.recorded, engine.strayed)
    amended = rival
    for recorded, again in ((True, False), (True, True), (False, False)):
        off = strayed(scene, amended) if recorded else engine.strayed
        if (again or recorded == held[0]) and not off:
            continue
        engine.follow(recorded)
        engine.amend(off)
        fitted = amended.fitted
        other = rated(scene, fit(scene, scene.train, fitted.causes, fitted.point, amended.noises, LONG))
        other = _unwhitened(scene, other)
        if recorded:
            amended = other
        if best.score - other.score > TIE:
            best, held = other, (recorded, off)
    engine.follow(held[0])
    engine.amend(held[1])
    return best


def _refined(scene: Scene, rival: Rival) -> Rival:
    """Go on by finer steps where the coarse ones leave a trace beside little noise: the next effect would take it."""
    engine, fitted = scene.engine, rival.fitted
    if engine.longest_change <= LONGEST_CHANGE:
        return rival
    coarse = engine.longest_change
    engine.hasten(LONGEST_CHANGE)
    finer = fit(scene, scene.train, fitted.causes, fitted.point, rival.noises, 0)
    pairs = zip(finer.residuals, fitted.residuals, strict=True)
    if sum(float(np.sum(whitened(one - other, rival.noises) ** 2)) for one, other in pairs) > TIE:
        return rated(scene, fit(scene, scene.train, fitted.causes, fitted.point, rival.noises, LONG))
    engine.hasten(coarse)
    return rival


def _unwhitened(scene: Scene, rival: Rival) -> Rival:
    """Fit once more as if all noise were white innovations, and then with what that leaves, if that explains more.

    Whitened residuals show edges, where a wrong moment is a trap. Plain ones show the slow course, and most that of the
    slowest output, which leads out. A nominal parameter that ran away in such a trap begins where it was given.
    """
    fitted = rival.fitted
    given = runaways(scene, fitted)
    found = [rival]
    if given or colored(rival.noises):
        sizes = [white(noise.scale) for noise in rival.noises]
        plain = fit(scene, scene.train, fitted.causes, fitted.point, sizes, LONG)
        noises, last = noises_of(scene, plain.residuals), math.inf
        while (size := sum(math.log(noise.rms) for noise in noises)) < last - _NEARER:
            last = size  # it had ended in a valley that went on
            plain = fit(scene, scene.train, fitted.causes, plain.point, flat(noises), LONG)
            noises = noises_of(scene, plain.residuals)
        begin = Point({**plain.point.values, **given}, plain.point.starts)
        found.append(rated(scene, fit(scene, scene.train, fitted.causes, begin, noises, LONG)))
    return min((each for each in found if not larger(each, rival)), key=lambda each: each.score)


def _nearer(scene: Scene, rival: Rival, base: Rival) -> Rival:
    """Lead an explanation that only whitens what is left back to where simulations come closer, if that is as good."""
    return _unwhitened(scene, rival) if larger(rival, base) and rival.score < base.score else rival


def _accompanied(scene: Scene, rival: Rival, base: Rival, worth: float) -> Rival:
    """Return an explanation that only whitens what is left with the effect beside it, after which it comes nearer.

    Of two effects one may hide what the other does: a load makes simulations drift away that a slew rate made right.
    As it was where neither is worth its name, or it is none.
    """
    if not _pays(scene, rival, base) or len(rival.fitted.causes) >= MOST_EFFECTS:
        return rival
    rivals = tried_beside(scene, rival, screened(scene, rival), (), worth)
    if not rivals:
        return rival
    both = simplest(rivals, rival.score)
    return both if _earned(scene, both, rival) and not larger(both, base) else rival


def _earned(scene: Scene, rival: Rival, base: Rival) -> bool:
    """Tell whether the newest effect brings what it must, on train too, and comes no further from every output."""
    return not larger(rival, base) and _pays(scene, rival, base)


def _pays(scene: Scene, rival: Rival, base: Rival) -> bool:
    """Tell whether the newest effect brings what it must, on train too."""
    gain = base.score - rival.score
    return gain >= _bar(scene, rival, base, gain) and tells(rival, base) and not faint(scene, rival, base)


def _bar(scene: Scene, rival: Rival, base: Rival, gain: float) -> float:
    """Return the drop of BIC the newest effect must bring: more where a slow disturbance could be all it is.

    Of an effect that lasts batches tell that, where simulations come nearer; `gain` is what it did bring.
    """
    newest, values = rival.fitted.causes[-1], rival.fitted.point.values
    least = THRESHOLD
    if any(len(noise.coefficients) >= LONG_MEMORY for noise in rival.noises):
        least = SLOW_THRESHOLD if creeps(newest, values) else COLORED_THRESHOLD
        times = times_chance(scene, rival.fitted, rival.noises, newest)
        if accidental(newest, times, gain):
            return np.inf
        nearer = any(mine.rms < theirs.rms for mine, theirs in zip(rival.noises, base.noises, strict=True))
        if nearer and _SURE < times < np.inf:  # what lasts hardly shows in innovations
            least = 0.0 if closer(scene, rival, base) else THRESHOLD
    sizes = [noise.rms for noise in rival.noises]
    if newest.effect.limits and newest.output in {each.output for each in coarse(scene.plant, scene.train, sizes)}:
        least = _STEPPED
    return least + (_SEARCHED if any(key.endswith(_SOUGHT) for key in newest.keys) else 0.0)


def _nominal(scene: Scene) -> Rival:
    """Fit the nominal plant from several starts with white noise, then with the noise it left over."""
    begin = first_point(scene, scene.train)
    spread = [np.std(np.concatenate([outputs for outputs in column])) for column in _columns(scene)]
    whole = [white(max(float(size), float(floor), 1e-12)) for size, floor in zip(spread, scene.floors, strict=True)]
    trials = []
    for factor in _SPREAD:
        values = {
            p.name: p.value * (factor if p.free and p.name.startswith(("R_", "J_", "b_", "mass")) else 1.0)
            for p in scene.plant.parameters
        }
        trials.append(fit(scene, scene.train, (), Point({**begin.values, **values}, begin.starts), whole, SHORT * 2))
    fitted = min(trials, key=lambda each: each.cost)
    for _ in range(2):
        fitted = fit(scene, scene.train, (), fitted.point, flat(noises_of(scene, fitted.residuals)), LONG)
    plain = last = rated(scene, fitted)
    fits = [plain]
    for _ in range(3):
        last = rated(scene, fit(scene, scene.train, (), last.fitted.point, last.noises, LONG))
        if not farther(last, plain):  # what simulates worse than the plain refit has made noise of the motion
            fits.append(last)
    return min(fits, key=lambda each: each.score)


def _columns(scene: Scene) -> list[list[Array]]:
    return [[recording.columns[signal.name] for recording in scene.train] for signal in scene.plant.outputs]


def pruned(scene: Scene, best: Rival) -> Rival:
    """Drop effects one by one as long as the rest explains as much, and no output is missed by far more."""
    while len(best.fitted.causes) > 1:
        slimmer = [
            rated(scene, fit(scene, scene.train, *relieved(scene, best.fitted, cause, best.noises), best.noises, LONG))
            for cause in best.fitted.causes
        ]
        least = min(slimmer, key=lambda each: each.score)
        spared = _spared(scene, best, least)
        if not spared and meeting(least.fitted.causes):
            least = rated(scene, past_contacts(scene, least.fitted, least.noises))
            spared = _spared(scene, best, least)
        if not spared:
            return best
        best = least
    return best


def _spared(scene: Scene, best: Rival, slim: Rival) -> bool:
    """Tell whether the best can do without what a slimmer one has not, which may be the average of a disturbance.

    Unseen recordings only confirm what brings something on train, too.
    """
    if any(one.rms > _FAR_MORE * other.rms for one, other in zip(slim.noises, best.noises, strict=True)):
        return False
    lost, gone = slim.score - best.score, set(best.fitted.causes) - set(slim.fitted.causes)
    silent = evidence(slim.fitted, slim.noises) < evidence(best.fitted, best.noises)
    return silent or lost < THRESHOLD or by_chance(scene, best.fitted, best.noises, gone, lost)
