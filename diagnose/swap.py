"""Put one effect in the place of another: what it contains, what contains it, and what it is mistaken for."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from firmloop.diagnose.descent import residual_of
from firmloop.diagnose.hypothesis import Cause, Point, Scene, entered
from firmloop.diagnose.refit import Fitted, evidence, fit, own_evidence
from firmloop.diagnose.rival import (
    MINOR,
    RICHER,
    TIE,
    Rival,
    contain,
    containing,
    larger,
    rated,
    related,
    richer,
    rms_of,
    without,
)

_STARTS = 3  # from which one effect is tried in the place of another
_SHORT, _LONG = 3, 12  # steps of a trial and of a final fit
_HOPELESS = 0.25  # of the drop that all effects have brought, behind which a trial after a few steps is left
_TRIAL = 2.0  # million steps of simulation for a trial, after which no further step is made
_SAME = 0.1  # of that drop, that may be missing where two effects are the same for all that is known of them
_PATIENCE = 40.0  # million steps of simulation after which nothing further is tried


def swapped(scene: Scene, best: Rival, gain: float) -> tuple[Rival, tuple[Rival, ...]]:
    """Put what an effect is mistaken for in its place, one by one; return the best and all that was tried."""
    tried: list[Rival] = []
    seen = {frozenset(cause.label for cause in best.fitted.causes)}
    begun = scene.engine.steps
    for gone, come in mistaken(scene, best.fitted):
        labels = frozenset(c.label for c in (*best.fitted.causes, come) if c != gone)
        if labels not in seen and scene.engine.steps - begun < _PATIENCE:
            seen.add(labels)
            tried.append(_translated(scene, best, gone, come, _HOPELESS * gain))
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
            again = rated(scene, fit(scene, scene.train, best.fitted.causes, best.fitted.point, winner.noises, _LONG))
            if again.score < winner.score:
                return again, tuple(sorted((best, *tried), key=lambda each: each.score))
            return winner, (best, *tried)
    return best, tuple(sorted(tried, key=lambda each: each.score))


def mistaken(scene: Scene, best: Fitted) -> list[tuple[Cause, Cause]]:
    """Return each cause of the best with what it may be mistaken for, first what is most likely for each."""
    found: list[tuple[int, Cause, Cause]] = []
    for gone in best.causes:
        names = (*gone.effect.confusable_with, *related(gone.effect.name))
        for come in scene.causes:
            if come not in best.causes and come.effect.name in names:
                found.append((names.index(come.effect.name), gone, come))
            elif come not in best.causes and gone.effect.name in come.effect.confusable_with:
                found.append((len(names), gone, come))
    return [(gone, come) for _, gone, come in sorted(found, key=lambda each: each[0])]


def amounting(scene: Scene, best: Rival, gain: float) -> Rival:
    """Put the simpler effect in the place of one whose values amount to it; `gain` is what all effects have brought."""
    allowed = max(RICHER, _SAME * gain)
    return next((one for one in plainer(scene, best) if one.score - best.score < allowed), best)


def plainer(scene: Scene, best: Rival) -> Iterator[Rival]:
    """Fit the simpler effect, by the noises of the best, in the place of each one whose values amount to it."""
    for gone in best.fitted.causes:
        come = scene.cause(amounts_to(best.fitted, gone))
        if come is not None and come not in best.fitted.causes:
            yield _translated(scene, best, gone, come)


def amounts_to(fitted: Fitted, cause: Cause) -> str:
    """Name the simpler effect that a cause with its values amounts to; blank for none."""
    if cause.effect.becomes is None:
        return ""
    return cause.effect.becomes([fitted.point.values[key] for key in cause.keys], cause.scales)


def merged(scene: Scene, best: Rival, gain: float) -> Rival:
    """Put one effect in the place of those whose sum it is, where that explains as much."""
    for come in scene.causes:
        parts = {name: shares for name, shares in come.effect.sum_of}
        gone = [cause for cause in best.fitted.causes if cause.effect.name in parts]
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
        one = rated(scene, fit(scene, scene.train, (*kept, come), begin, best.noises, _LONG))
        if one.score - best.score < max(TIE, MINOR * gain):
            return one
    return best


def parted(scene: Scene, best: Rival, gain: float) -> Rival:
    """Put the parts of a sum in its place, one of them as a richer effect, where those explain clearly more.

    A load beside a friction that falls with speed is at first a friction of two sizes, and then a drag beside it.
    """
    found = [best]
    for gone in best.fitted.causes:
        names, shares = zip(*gone.effect.sum_of, strict=True) if gone.effect.sum_of else ((), ())
        parts = [each for each in map(scene.cause, names) if each is not None and each not in best.fitted.causes]
        if not parts or len(parts) < len(names):
            continue
        values = [best.fitted.point.values[key] for key in gone.keys]
        sizes = np.linalg.lstsq(np.transpose(shares), values, rcond=None)[0]
        kept, rest = without(best.fitted, gone)
        whole = {**rest.values, **{each.keys[0]: float(size) for each, size in zip(parts, sizes, strict=True)}}
        same = replace(best.fitted, causes=(*kept, *parts), point=Point(whole, rest.starts))
        found += [
            _translated(scene, replace(best, fitted=same), part, come)
            for part in parts
            for come in scene.causes
            if come.effect.name in containing(part.effect.name) and come != gone and come not in kept
        ]
    winner = min(found, key=lambda each: each.score)
    return winner if richer(winner, best, gain) and not larger(winner, best) else best


def relatives(scene: Scene, rival: Rival, known: Collection[tuple[Cause, ...]]) -> list[Rival]:
    """Fit what the newest effect contains and what contains it, but for `known` causes, from the values they share."""
    newest = rival.fitted.causes[-1]
    names = related(newest.effect.name)
    kept = rival.fitted.causes[:-1]
    return [
        _translated(scene, rival, newest, cause)
        for cause in scene.causes
        if cause.effect.name in names and cause not in kept and (*kept, cause) not in known
    ]


def alike(one: Cause, other: Cause) -> dict[str, str]:
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


def exchanged(base: Fitted, gone: Cause, come: Cause, start: Mapping[str, float]) -> tuple[tuple[Cause, ...], Point]:
    """Put one cause at its start in the place of another; the nominal inertia stays beside a load that both have."""
    kept, rest = without(base, gone)
    values, before = dict(entered(rest.values, come, start)), base.point.values
    if gone.taken is not None and come.taken is not None and start[come.taken[0]] == before[gone.taken[0]]:
        values[come.taken[1]] = before[come.taken[1]]
    return (*kept, come), Point(values, rest.starts)


def _translated(scene: Scene, rival: Rival, gone: Cause, come: Cause, behind: float = np.inf) -> Rival:
    """Put one cause in the place of another, and fit from the best of the starts of what they do not share.

    A trial that is too far `behind` in evidence is not fitted to the end.
    """
    values = rival.fitted.point.values
    shared = {key: values[own] for key, own in alike(gone, come).items()}
    starts = [{**start, **shared} for start in scene.starts[come.label]]
    distinct = list({tuple(sorted(start.items())): start for start in starts}.values())[:_STARTS]
    trials = []
    for start in distinct:
        begin = exchanged(rival.fitted, gone, come, start)
        trials.append(fit(scene, scene.train, *begin, rival.noises, _SHORT, _TRIAL))
    best = min(trials, key=lambda each: each.cost)
    if own_evidence(scene, best) - evidence(rival.fitted, rival.noises) > behind:
        return rated(scene, best)
    return rated(scene, fit(scene, scene.train, best.causes, best.point, rival.noises, _LONG))


def as_large(
    scene: Scene, fitted: Fitted, gone: Cause, come: Cause, start: Mapping[str, float]
) -> Mapping[str, float] | None:
    """Return a start with its size scaled so that one cause does most nearly what the other did.

    Where both are one function of the recordings a fit from there has nothing left to do. None where it would have to
    do the opposite, or does nothing.
    """
    _, bare = without(fitted, gone)
    _, point = exchanged(fitted, gone, come, start)
    weights = 1.0 / np.maximum(rms_of(fitted.residuals), 1e-300)
    size = share = 0.0
    for k, (each, left) in enumerate(zip(scene.train, fitted.residuals, strict=True)):
        before = residual_of(scene, each, bare, k)
        does = before - residual_of(scene, each, point, k)
        size += float(np.sum((weights * does) ** 2))
        share += float(np.sum(weights**2 * does * (before - left)))
    if not (np.isfinite(size) and size > 0.0 and share > 0.0):
        return None
    unit = come.parameters[0].unit if come.parameters else ""
    scaled = {key for key, each in zip(come.keys, come.parameters, strict=True) if each.unit == unit}
    return {key: value * share / size if key in scaled else value for key, value in start.items()}
