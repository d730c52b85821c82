"""Keep of an explanation what holds where it was left out of the fit: the rest has only followed these very rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.batch_means import with_disturbances
from firmloop.diagnose.model.candidate import (
    Candidate,
    beyond_chance,
    by_simulation_error,
    clearly_nearer,
    likely,
    memories,
    residual_sizes,
)
from firmloop.diagnose.model.fit import Fitted, ended, fit, inverse, noises_of, strength, with_other_answer
from firmloop.diagnose.model.hypothesis import LibraryTerm
from firmloop.diagnose.model.scale_doubt import with_doubt_of_given
from firmloop.diagnose.policy import (
    CLOSER_RMS,
    EXCHANGE_PATIENCE,
    LEVELLED_WITHIN,
    NEARER_RMS,
    SAME_RMS,
    SHAPE_SHARE,
    WIDER_RMS,
)
from firmloop.diagnose.search.exchange import slimmer
from firmloop.diagnose.search.found import Search, as_near, candidates_of, near_best
from firmloop.diagnose.search.harmless import Simulations, no_worse, same_function
from firmloop.diagnose.search.improved import improved_plant
from firmloop.diagnose.search.left_out import Contender, LeftOut, left_out
from firmloop.diagnose.search.simulation_error import independent, misfits, nearer
from firmloop.identify.fitting.noise import oversized, white
from firmloop.identify.normal import NORMAL_95

Array = NDArray[np.float64]
Figures = Mapping[str, Mapping[str, float]]  # by output, by explanation: rms where it was left out


@dataclass(frozen=True, slots=True)
class _Part:
    """A search whose best is a part of an explanation; `safe` where it may be written.

    `seen` is the rms over the refit's where readings begin all simulations of train.
    """

    search: Search
    safe: bool
    left: LeftOut
    seen: float

    @property
    def terms(self) -> tuple[LibraryTerm, ...]:
        """The effects of the part."""
        return self.search.best.fitted.terms

    @property
    def ratio(self) -> float:
        """The rms over the refit's of what was left out, squares averaged over outputs; of train where none is told."""
        return _ratio(self.left.figures) or self.seen

    @property
    def foresees(self) -> bool:
        """What was left out comes far nearer than by the refit, or nearer and what is left is white; no output less so.

        So do simulations of train, as fitted: else a refit to less of it has only lost its way. White noise as large as
        what is left leaves nothing to explain.
        """
        pairs = [(each.get("after", np.inf), each.get("refit", 0.0)) for each in self.left.figures.values()]
        bare = all(noise.rms < WIDER_RMS * noise.scale for noise in self.search.best.noises)
        least = NEARER_RMS if bare else CLOSER_RMS
        ahead = 0.0 < _ratio(self.left.figures) < least and all(mine <= SAME_RMS * theirs for mine, theirs in pairs)
        best, nominal = self.search.best.fitted, self.search.nominal.fitted
        return ahead and likely(best) and nearer(best, nominal)


@dataclass(frozen=True, slots=True)
class _Bench:
    """What parts are held against; `before` is the fit that was searched, whose intervals are known."""

    refit: Simulations
    before: Fitted

    @property
    def refit_rms(self) -> Array:
        """Return what simulations of the refit leave (2, recordings, r), rms."""
        return self.refit.from_starts()

    def part(self, search: Search) -> _Part:
        """Simulate what the best of a search is written as, and what is left out of its fit.

        The deviations of a fit made anew are widened to what slow disturbances leave of them.
        """
        best = search.best.fitted
        if best.residuals is not self.before.residuals:
            search = replace(search, best=replace(search.best, fitted=with_disturbances(search.problem, best)))
        rms = Simulations(improved_plant(search, search.best), self.refit.recordings).from_starts()
        safe = likely(search.best.fitted) and no_worse(rms, self.refit_rms)
        seen = float(np.sqrt(np.mean((rms[1] / np.maximum(self.refit_rms[1], 1e-300)) ** 2)))
        return _Part(search, safe, self.left_out(search), seen if np.isfinite(seen) else 0.0)

    def plain(self, found: Search) -> _Part:
        """Return a fit of the best's effects by plain simulation error, one that harms nothing where there is one."""
        part = self.part(found)
        if part.safe or self.refit_rms[1].size == 1 or not np.all(np.isfinite(self.refit_rms[1])):
            return part
        other = self.part(_untraded(found, self.refit_rms[1]))
        return other if other.safe else part

    def left_out(self, found: Search) -> LeftOut:
        """Return how far simulations are off where it was left out of the fit: of the refit, and of the best."""
        values = {**found.nominal.fitted.point.values, **{p.name: p.value for p in self.refit.plant.parameters}}
        best, plain = found.best.fitted, Contender((), values, {})
        starts = {id(each): start for each, start in zip(found.problem.train, best.point.starts, strict=True)}
        shown = Contender(best.terms, best.point.values, starts) if best.terms else plain
        return left_out(found.problem, {"refit": plain, "after": shown}, residual_sizes(best.residuals))


class Kept(NamedTuple):
    """The search whose best holds, None where nothing does, and the figures of what was left out.

    `safe` where its plant is known to harm no simulation of train that begins where readings say.
    """

    search: Search | None
    figures: Figures
    safe: bool = False


def told(figures: Figures) -> bool:
    """Tell whether an explanation simulates what was left out clearly nearer than the plain refit does."""
    return _ratio(figures) < NEARER_RMS


def _ratio(figures: Figures) -> float:
    """Return the rms over the refit's where it was left out, squares averaged over outputs; 0 where nothing is told."""
    pairs = [(each.get("after", 0.0), each.get("refit", 0.0)) for each in figures.values()]
    ratios = [after / refit for after, refit in pairs if refit > 0.0]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else 0.0


def holding(found: Search, refit: Simulations) -> Kept:
    """Return the search with the part of its best that harms no simulation, of left-out parts either; None if none.

    Where there is none, it is the whole if what was left out is simulated far nearer once its start is fitted.
    With it the figures of what was left out. Effects go one by one, each time the one without which that is simulated
    nearest: as long as some recording is harmed; where it is not simulated clearly nearer than by the plain refit, as
    long as it is clearly nearer without; and those that may be none by their own intervals, unless it is nearer with
    them than by chance.
    """
    bench, found = _Bench(refit, found.best.fitted), _as_simulated(found)
    if not found.best.fitted.terms:
        return Kept(found, bench.left_out(found).figures)
    kept = _kept(found, bench)
    return kept if kept.search is not None else _rival(found, bench, _ratio(kept.figures)) or kept


def _as_simulated(found: Search) -> Search:
    """Return the search with what simulates nearest for the number of its values as its best, where a misfit is left.

    Innovations tell of noise. Of explanations that all leave what answers the input, details of that would decide; they
    are told apart by what they leave in independent samples (BIC), and what those do not tell apart by no more values
    stands beside.
    """
    problem, best = found.problem, found.best
    if not best.fitted.terms or problem.samples or not misfits(found):
        return found
    tried, until = [_plainly(found, best.fitted).best], problem.engine.steps + EXCHANGE_PATIENCE
    for other in candidates_of(found):
        if problem.engine.steps < until and likely((plain := _plainly(found, other.fitted).best).fitted):
            tried.append(plain)
    samples = sum(map(len, best.fitted.residuals)) / memories(tried[0].fitted.residuals)
    scores = [
        float(2.0 * samples @ np.log(residual_sizes(each.fitted.residuals)))
        + len(each.fitted.coordinates) * float(np.log(np.sum(samples)))
        for each in tried
    ]
    least = int(np.argmin(np.nan_to_num(scores, nan=np.inf)))  # one that has diverged is none
    rated = [replace(each, score=best.score + own - scores[least]) for each, own in zip(tried, scores, strict=True)]
    count = len(best.fitted.terms)
    rounds = tuple(tuple(each for each in turn if len(each.fitted.terms) != count) for turn in found.rounds)
    values = len(tried[least].fitted.coordinates)
    beside = tuple(each for each in rated if each is not rated[least] and len(each.fitted.coordinates) <= values)
    return replace(found, best=rated[least] if least else best, rounds=(*rounds, beside))


def _rival(found: Search, bench: _Bench, off: float) -> Kept | None:
    """Return the nearest that holds of all that innovations hardly tell from the best, which does not; None if none.

    Beside it stands only what comes about as near, be it the best: `off` is its rms over the refit's.
    """
    within = max(LEVELLED_WITHIN, SHAPE_SHARE * (found.nominal.score - found.best.score))
    near = {terms: each for terms, each in near_best(found, within).items() if as_near(found, each)}
    asked = {terms: _kept(replace(found, best=each), bench) for terms, each in near.items()}
    ratios = {terms: _ratio(each.figures) for terms, each in asked.items() if each.search is not None}
    nearest = min(ratios, key=lambda terms: ratios[terms], default=None)
    if nearest is None or (search := asked[nearest].search) is None:
        return None
    best = found.best.fitted
    ratios = {**ratios, frozenset(best.terms): off if likely(best) else np.inf}
    beside = {terms for terms, ratio in ratios.items() if CLOSER_RMS * ratio < ratios[nearest]}
    gone = {frozenset(best.terms), *near} - beside
    rounds = tuple(tuple(each for each in turn if frozenset(each.fitted.terms) not in gone) for turn in search.rounds)
    return asked[nearest]._replace(search=replace(search, rounds=rounds))


def _kept(found: Search, bench: _Bench) -> Kept:
    """Return what holds of the best; see `holding`."""
    here = whole = _whole(found, bench)
    while (slim := _slimmed(here, bench)) is not None:
        here = slim
    fitted = here.search.best.fitted
    none = all(strength(fitted, each) <= NORMAL_95 for each in fitted.terms) and not _shows(here)
    # What explains motion that is no noise brings simulations nearer, by as much as it leaves if that is none; of what
    # may be noise innovations may tell more.
    most = 1.0 / (SAME_RMS if oversized(found.nominal.noises) else NEARER_RMS)
    if oversized(noises_of(found.problem, fitted.residuals)):
        most = CLOSER_RMS
    if not here.safe:  # what is right may begin nowhere that readings say
        noisy = not oversized(found.nominal.noises) and whole.ratio < NEARER_RMS and likely(whole.search.best.fitted)
        right = [each for each in (here, whole) if each.foresees] or ([whole] if noisy else [])
        best = min(right, key=lambda each: each.ratio, default=None)
        return Kept(None, here.left.figures) if best is None else Kept(best.search, best.left.figures, best.safe)
    if none or here.ratio >= most:
        return Kept(None, here.left.figures)
    kept = here.search if _as_found(here.search, found) else _with_same(here.search)
    return Kept(kept, here.left.figures, here.safe)


def _slimmed(here: _Part, bench: _Bench) -> _Part | None:
    """Return the next smaller part; None where all that is left of it is needed."""
    fitted = here.search.best.fitted
    weakest = min(fitted.terms, key=lambda each: strength(fitted, each))
    lots: list[tuple[Sequence[LibraryTerm], Callable[[_Part], bool]]] = []
    if not here.safe:
        lots.append((fitted.terms, lambda each: True))
    elif here.ratio > NEARER_RMS:
        lots.append((fitted.terms, lambda each: each.ratio <= NEARER_RMS * here.ratio))
    if strength(fitted, weakest) <= NORMAL_95:
        # With a special case in its place the effect stays: only what its interval does not tell goes.
        lots.append(((weakest,), lambda each: len(each.terms) == len(here.terms) or not _needs(here, each)))
    for some, enough in lots:
        parts = [each for each in _smaller(here.search, bench, some) if each.safe or not here.safe]
        # Those that may be written first.
        least = min(parts, key=lambda each: (not each.safe, each.ratio), default=None)
        if least is not None and enough(least):
            return least
    return None


def _shows(here: _Part) -> bool:
    """Tell whether some effect cannot be nothing, though its interval may say so where its scale is not known.

    Where what was left out is far nearer than by the plain refit, and by more than chance. What lasts soaks up drifts.
    """
    mine, theirs = here.left.residuals.get("after", ()), here.left.residuals.get("refit", ())
    clear = len(mine) > 0 and here.ratio < CLOSER_RMS and beyond_chance(mine, theirs)
    return clear and not any(each.effect.lasting for each in here.terms)


def _needs(here: _Part, slim: _Part) -> bool:
    """Tell whether what was left out is nearer than by a smaller part, by more than chance where it is the same."""
    mine, theirs = here.left.residuals.get("after", ()), slim.left.residuals.get("after", ())
    if len(mine) != len(theirs):
        return here.ratio < slim.ratio
    return len(mine) > 0 and beyond_chance(mine, theirs)


def _smaller(found: Search, bench: _Bench, some: Sequence[LibraryTerm]) -> Iterator[_Part]:
    """Yield the parts without one of some effects, or with a simpler one in its place, by plain simulation error."""
    problem, fitted = found.problem, found.best.fitted
    bare = replace(found, rounds=())  # what stood beside the whole is no rival of a part
    for gone in some:
        for terms, point in slimmer(problem, fitted, gone):
            if terms:
                yield bench.part(_plainly(bare, replace(fitted, terms=terms, point=point)))


def _whole(found: Search, bench: _Bench) -> _Part:
    """Return the best as found where no other values simulate clearly nearer, and its effects are certain.

    Where some do, a noise model has made noise of the motion: the values are those of plain simulation error, unless
    only starts that nobody reads make them nearer, and as written they are not.
    """
    before = found.best.fitted
    plainly = _plainly(found, before)
    far = clearly_nearer(plainly.best.fitted, before)
    plain = bench.plain(plainly) if far else None
    if plain is None or not plain.safe:
        other = before if far else with_other_answer(before, plainly.best.fitted.point.values)
        noisy = not oversized(found.best.noises)  # else intervals are those of a misfit
        if noisy or all(strength(other, term) > NORMAL_95 for term in before.terms):
            made = bench.part(replace(found, best=replace(found.best, fitted=other)))
            if made.safe:
                return made
    return plain or bench.plain(plainly)


def _plainly(found: Search, begin: Fitted) -> Search:
    """Return the search with a fit by plain simulation error as its best, independent samples counted."""
    fitted = by_simulation_error(found.problem, begin)
    noises = independent(fitted.residuals)
    fitted = with_doubt_of_given(found.problem, ended(found.problem, fitted, noises))
    return replace(found, best=replace(found.best, fitted=fitted, noises=noises))


def _untraded(found: Search, left: Array) -> Search:
    """Return the search with its best fitted anew, each output of each recording weighed by what the refit has `left`.

    `left` (recordings, r) is rms. So none is traded for another. What that leaves uncertain is the sandwich of Huber,
    filled by independent samples.
    """
    problem = found.problem
    left = np.maximum(np.maximum(left, problem.floors), 1e-30)
    sizes = np.sqrt(np.mean(left**2, axis=0))
    weights = {id(each): own for each, own in zip(problem.train, sizes / left, strict=True)}
    weighed = replace(problem, memory={}, weights=weights, floors=problem.floors * np.min(sizes / left, axis=0))
    fitted = by_simulation_error(weighed, found.best.fitted, sizes)
    fitted, noises = ended(weighed, fitted, fitted.noises), independent(fitted.residuals)
    filling = [white(one.scale**2 / other.scale) for one, other in zip(fitted.noises, noises, strict=True)]
    inner = fit(weighed, weighed.train, fitted.terms, fitted.point, filling, 0).normal
    plain = fit(problem, problem.train, fitted.terms, fitted.point, fitted.noises, 0).residuals
    noises = independent(plain)
    normal = fitted.normal @ inverse(inner) @ fitted.normal
    fitted = with_doubt_of_given(problem, replace(fitted, residuals=plain, noises=noises, normal=normal))
    return replace(found, best=replace(found.best, fitted=fitted, noises=noises))


def _as_found(here: Search, found: Search) -> bool:
    """Tell whether the best still has the noises that the search found."""
    return here.best.noises is found.best.noises


def _with_same(found: Search) -> Search:
    """Return the search with what simulates just as well as its best beside it."""
    same = same_function(found.problem, found.best.fitted)
    beside = tuple(Candidate(each, independent(each.residuals), found.best.score) for each in same)
    return replace(found, rounds=(*found.rounds, beside))
