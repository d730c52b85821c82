"""Keep of an explanation what holds where it was left out of the fit: the rest has only followed these very rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from firmloop.diagnose.model.candidate import (
    Candidate,
    believable,
    by_simulation_error,
    clearly_nearer,
    residual_sizes,
)
from firmloop.diagnose.model.fit import Fitted, strength, with_other_answer
from firmloop.diagnose.model.hypothesis import LibraryTerm
from firmloop.diagnose.policy import SAME_RMS
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

    With it the figures of what was left out. Effects go one by one: as long as the plain refit simulates those parts
    nearer the one without which they are simulated nearest, then each that may be none by its own interval, as long as
    they are simulated no worse without it.
    """
    safe = unharmed(found, refit, recordings)
    figures = left_out(safe or found, refit)
    while safe is not None and not _holds(figures):
        slim = _slimmer(safe, refit, recordings, safe.best.fitted.terms)
        safe, figures = _nearest([(each, left_out(each, refit)) for each in slim], figures)
    while safe is not None and (doubted := _doubted(safe.best.fitted)):
        slim = _slimmer(safe, refit, recordings, doubted[:1])
        other, others = _nearest([(each, left_out(each, refit)) for each in slim], figures)
        if other is None or _worst(others) > SAME_RMS * _worst(figures):
            break
        safe, figures = other, others
    return safe, figures


def _nearest(pairs: Sequence[tuple[Search, Figures]], without: Figures) -> tuple[Search | None, Figures]:
    """Return the search that simulates what was left out nearest, and its figures; None with those `without` any."""
    return min(pairs, key=lambda pair: _worst(pair[1]), default=(None, without))


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


def _holds(figures: Figures) -> bool:
    """Tell whether an explanation simulates what was left out no worse than the refit does."""
    return _worst(figures) <= SAME_RMS


def _worst(figures: Figures) -> float:
    """Return the largest ratio of an explanation's rms to the refit's over the outputs; 0 where nothing is told."""
    pairs = [(each.get("after", 0.0), each.get("refit", 0.0)) for each in figures.values()]
    return max((after / refit for after, refit in pairs if refit > 0.0), default=0.0)
