"""Keep of an explanation what holds where it was left out of the fit: the rest has only followed these very rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from firmloop.diagnose.model.candidate import (
    Candidate,
    believable,
    by_simulation_error,
    clearly_nearer,
    residual_sizes,
)
from firmloop.diagnose.model.fit import Fitted, strength, with_other_answer
from firmloop.diagnose.model.hypothesis import LibraryTerm
from firmloop.diagnose.policy import NEARER_RMS, SAME_RMS
from firmloop.diagnose.search.exchange import slimmer
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.harmless import harmless, same_function
from firmloop.diagnose.search.improved import improved_plant
from firmloop.diagnose.search.left_out import Contender, left_out_rms
from firmloop.diagnose.search.simulation_error import certain, independent
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Figures = Mapping[str, Mapping[str, float]]  # by output, by explanation: rms where it was left out


def holding(found: Search, refit: Plant, recordings: Sequence[Recording]) -> tuple[Search | None, Figures]:
    """Return the search with the part of its best that harms no simulation, of left-out parts either; None if none.

    With it the figures of what was left out. Where the best simulates that not clearly nearer than the plain refit,
    effects go one by one as long as it is simulated clearly nearer without; then each that may be none by its own
    interval, as long as it is simulated no worse without.
    """
    safe = unharmed(found, refit, recordings)
    figures = left_out(safe or found, refit)
    while safe is not None and _ratio(figures) > NEARER_RMS:
        other, others = _nearest(safe, refit, recordings, safe.best.fitted.terms)
        if other is None or _ratio(others) > NEARER_RMS * _ratio(figures):
            break
        safe, figures = other, others
    while safe is not None and (doubted := _doubted(safe.best.fitted)):
        other, others = _nearest(safe, refit, recordings, doubted[:1])
        if other is None or _ratio(others) > SAME_RMS * _ratio(figures):
            break
        safe, figures = other, others
    return (safe if NEARER_RMS * _ratio(figures) < 1.0 else None), figures


def _nearest(
    found: Search, refit: Plant, recordings: Sequence[Recording], some: Sequence[LibraryTerm]
) -> tuple[Search | None, Figures]:
    """Return the search without one of some effects that simulates what was left out nearest, and its figures."""
    slim = [(each, left_out(each, refit)) for each in _slimmer(found, refit, recordings, some)]
    return min(slim, key=lambda pair: _ratio(pair[1]), default=(None, {}))


def _doubted(fitted: Fitted) -> list[LibraryTerm]:
    """Return the effects that may be none by their own intervals, the least certain first; not the only one."""
    by_certainty = sorted(fitted.terms, key=lambda term: strength(fitted, term))
    return [term for term in by_certainty if strength(fitted, term) <= NORMAL_95] if len(by_certainty) > 1 else []


def left_out(found: Search, refit: Plant) -> Figures:
    """Return how far simulations are off where it was left out of the fit: of the refit, and of the best beside it."""
    values = {**found.nominal.fitted.point.values, **{p.name: p.value for p in refit.parameters}}
    best, plain = found.best.fitted, Contender((), values)
    shown = Contender(best.terms, best.point.values) if best.terms else plain
    return left_out_rms(found.problem, {"refit": plain, "after": shown}, residual_sizes(best.residuals))


def unharmed(found: Search, refit: Plant, recordings: Sequence[Recording]) -> Search | None:
    """Return the search, its best explanation with values that harm no simulation; None where there are none.

    As found where no other values simulate clearly nearer. Where some do, a noise model has made noise of the motion:
    the values are those of plain simulation error, beside the names that simulate just as well.
    """
    if not found.best.fitted.terms:
        return found
    problem, before = found.problem, found.best.fitted
    fitted = by_simulation_error(problem, before)
    if not clearly_nearer(fitted, before):
        doubted = replace(found, best=replace(found.best, fitted=with_other_answer(before, fitted.point.values)))
        noisy = not any(noise.weight for noise in found.best.noises)  # else intervals are those of a misfit
        sure = noisy or all(strength(doubted.best.fitted, term) > NORMAL_95 for term in before.terms)
        if sure and harmless(improved_plant(found, found.best), refit, recordings):
            return doubted
    return _plainly(found, fitted, refit, recordings)


def _plainly(found: Search, fitted: Fitted, refit: Plant, recordings: Sequence[Recording]) -> Search | None:
    """Return the search with a fit by plain simulation error as its best, and what simulates just as well beside it."""
    fitted = certain(found.problem, fitted)
    best = replace(found.best, fitted=fitted, noises=independent(fitted.residuals))
    other = replace(found, best=best)
    if not believable(fitted) or not harmless(improved_plant(other, best), refit, recordings):
        return None
    same = same_function(found.problem, fitted)
    beside = tuple(Candidate(each, independent(each.residuals), best.score) for each in same)
    return replace(other, rounds=(*other.rounds, beside))


def _slimmer(
    found: Search, refit: Plant, recordings: Sequence[Recording], some: Sequence[LibraryTerm]
) -> Iterator[Search]:
    """Yield searches without one of some effects, or with a simpler one, in the best, that harm no simulation."""
    problem, fitted = found.problem, found.best.fitted
    bare = replace(found, rounds=())  # what stood beside the whole is no rival of a part
    for gone in some:
        for terms, point in slimmer(problem, fitted, gone):
            if terms:
                one = by_simulation_error(problem, replace(fitted, terms=terms, point=point))
                made = _plainly(bare, one, refit, recordings)
                if made is not None:
                    yield made


def _ratio(figures: Figures) -> float:
    """Return the rms of an explanation over that of the refit, squares averaged over outputs; 0 if nothing is told."""
    pairs = [(each.get("after", 0.0), each.get("refit", 0.0)) for each in figures.values()]
    ratios = [after / refit for after, refit in pairs if refit > 0.0]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else 0.0
