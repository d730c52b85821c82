"""Say how often chance alone would let the best of all terms gain as much, under the nominal plant and its noise."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.finding import Gained
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, coordinates, entered, outputs_of
from firmloop.diagnose.model.slopes import residual_of, slopes_of, whitened
from firmloop.diagnose.policy import (
    CHANCE_DRAWS,
    CHANCE_PATIENCE,
    COARSE_CHANGE,
    COLORED_THRESHOLD,
    DETERMINED_DIRECTION,
    IMPOSSIBLE,
    LONG_MEMORY,
    MOMENTS_TRIED,
    MOST_DIRECTION_VALUES,
    PARALLEL,
    SLOWEST_BINS,
    THRESHOLD,
)
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.orders import linear_traces
from firmloop.diagnose.search.screen import Ground, ground
from firmloop.identify.fitting.noise import oversized
from firmloop.identify.fitting.projection import outside

Array = NDArray[np.float64]


def evidence_of(search: Search) -> Gained:
    """Return the drop of BIC from the refitted nominal plant to the best explanation, and its chance.

    Where nothing is named, the chance is that of the largest drop that any term promises. The chance is a parametric
    bootstrap of the largest drop (Davison & Hinkley 1997, section 4.2): the noise that the nominal plant leaves is
    drawn anew, and each term takes what its trace and the slopes of its parameters can take, at every start. Several
    effects are held against as many of the largest such drops, which two starts of one term may both hold: chance does
    less. Where that is as little as draws can tell, or what the nominal plant leaves is no noise, Bonferroni's bound
    over all such sets, by the law of each drop (Wilks 1938) in noise as loud as the loudest of its spectrum.
    """
    problem, nominal, best = search.problem, search.nominal, search.best
    gain = nominal.score - best.score
    library = len(problem.terms)
    if not abs(nominal.score) < IMPOSSIBLE or not abs(best.score) < IMPOSSIBLE:
        return Gained("BIC", math.nan, None, library)
    count, least = len(best.fitted.terms), 1.0 / (CHANCE_DRAWS + 1.0)
    # Beside a slow disturbance the search asks for that much more, too.
    slow = any(len(noise.coefficients) >= LONG_MEMORY for noise in best.noises)
    share = THRESHOLD / COLORED_THRESHOLD if slow else 1.0
    bound = math.inf
    if count:
        loudest = max(float(np.max(factors)) ** 2 for factors in _louder(search))
        bound = _bound(_most(problem), share * _likelier(search) / loudest, count)
    p_value: float | None = bound
    if bound >= least:  # below it, draws would say no more; and motion that is no noise cannot be drawn as such
        p_value = None if oversized(nominal.noises) else _by_draws(search, share, max(count, 1))
    return Gained("BIC", gain, None if p_value is None else min(max(p_value, least), 1.0), library)


def _by_draws(search: Search, share: float, count: int) -> float | None:
    """Return how often `count` terms gain a `share` of the drop from noise drawn anew; None where nothing can."""
    best = search.best
    innovations = [replace(noise, weight=0.0) for noise in best.noises]  # what is drawn anew has a row for each of them
    under = ground(search.problem, search.problem.train, search.nominal.fitted, innovations)
    groups, untraced = _directions(search, under)
    if not groups and not untraced:
        return None
    promised = [float(np.sum((each.T @ under.left) ** 2)) for each in groups]
    drop = share * (_likelier(search) if best.fitted.terms else max(promised, default=0.0))
    if groups and sum(each.size for each in groups) <= MOST_DIRECTION_VALUES:
        return _drawn(search, groups, drop, count) + _bound(untraced, drop / count, 1)
    return _bound([*(each.shape[1] for each in groups), *untraced], drop, count)


def _most(problem: Problem) -> list[int]:
    """Return the most directions that each term can have from each of its starts."""
    return [
        1 + len(term.keys) for term in problem.terms for _ in range(max(len(problem.starts[term.label]), MOMENTS_TRIED))
    ]


def _likelier(search: Search) -> float:
    """Return the drop of -2 log likelihood from the nominal plant to the best explanation."""
    nominal, best = search.nominal, search.best
    rows = sum(part.size for part in nominal.fitted.residuals)
    more = len(best.fitted.coordinates) - len(nominal.fitted.coordinates)
    return nominal.score - best.score + more * math.log(rows)


def _directions(search: Search, under: Ground) -> tuple[list[Array], list[int]]:
    """Return an orthonormal basis (rows, k) of what each term can do to whitened outputs from each of its starts.

    With them the sizes of those that there is no patience for.
    """
    problem, base, engine = search.problem, search.nominal.fitted, search.problem.engine
    recorded, longest = engine.recorded, engine.longest_change
    engine.follow(False)  # a recorded angle holds the very noise that is to be drawn anew
    engine.hasten(COARSE_CHANGE)
    traced = linear_traces(problem, base)
    found: list[Array] = []
    untraced: list[int] = []
    until = engine.steps + CHANCE_PATIENCE
    for name in sorted(traced):
        for moved in traced[name]():
            found += _basis(np.concatenate([whitened(each, under.noises) for each in moved]), under)
    for term in problem.terms:
        if term.effect.name in traced and term.at is None:
            continue
        for start in problem.starts[term.label]:
            if engine.steps > until:
                untraced.append(1 + len(term.keys))
                continue
            tall = _slopes(problem, base.point, term, start, under)
            if tall is not None:
                found += _basis(tall, under)
    engine.follow(recorded)
    engine.hasten(longest)
    return found, untraced


def _slopes(
    problem: Problem, base: Point, term: LibraryTerm, start: Mapping[str, float], under: Ground
) -> Array | None:
    """Return the whitened trace of a term and the slopes of its parameters (rows, 1 + k); None after a divergence."""
    point = Point(entered(base.values, term, start), base.starts)
    known = {parameter.name for parameter in problem.plant.parameters}
    unknowns = [each for each in coordinates(problem, (term,), point.values) if each.name not in known]
    parts = []
    for k, recording in enumerate(problem.train):
        left = residual_of(problem, recording, point, k)
        trace = under.residuals[k] - left
        none = np.zeros((*left.shape, 0))
        slopes = slopes_of(problem, recording, unknowns, point, k, left, none)
        whole = np.concatenate([trace[:, :, None], slopes], axis=2)
        parts.append(whitened(whole, under.noises))
    tall = np.concatenate(parts)
    return tall if np.all(np.isfinite(tall)) else None


def _basis(tall: Array, under: Ground) -> list[Array]:
    """Return an orthonormal basis of what the nominal unknowns cannot imitate, none where they can.

    The symmetric one (Löwdin 1950), which no order of rows or columns changes.
    """
    pure = outside(under.basis, tall)
    sizes, rest = np.linalg.norm(tall, axis=0), np.linalg.norm(pure, axis=0)
    live = rest > PARALLEL * np.maximum(sizes, 1e-300)
    if not np.any(live):
        return []
    scaled = pure[:, live] / rest[live]
    powers, turned = np.linalg.eigh(scaled.T @ scaled)
    kept = powers > DETERMINED_DIRECTION * powers[-1]
    if np.all(kept):
        return [scaled @ (turned / np.sqrt(powers)) @ turned.T]
    return [scaled @ (turned[:, kept] / np.sqrt(powers[kept]))]


def _louder(search: Search) -> list[Array]:
    """Return by recording how much louder than its noise model what is left is, as factors (n // 2 + 1, r) of spectra.

    A noise model of few coefficients misses what is slowest, where loads and drifts are: there chance does more.
    """
    best = search.best
    return [
        np.stack([_levels(noise.whiten(part[:, index])) for index, noise in enumerate(best.noises)], axis=1)
        for part in best.fitted.residuals
    ]


def _levels(innovations: Array) -> Array:
    """Return the root of the smoothed spectrum of innovations (n,), in units of white ones, where it is more."""
    powers = np.abs(np.fft.rfft(innovations)) ** 2 / len(innovations)
    ends = [0]
    while ends[-1] < len(powers):
        ends.append(ends[-1] + max(SLOWEST_BINS, ends[-1] // 2))
    ends = [*ends[:-2], len(powers)] if len(ends) > 2 else [0, len(powers)]
    middles = [0.5 * (low + high - 1) for low, high in pairwise(ends)]
    levels = [max(float(np.mean(powers[low:high])), 1.0) for low, high in pairwise(ends)]
    return np.asarray(np.sqrt(np.interp(np.arange(len(powers)), middles, levels)))


def _drawn(search: Search, groups: Sequence[Array], drop: float, count: int) -> float:
    """Return the share of draws of innovations of which the `count` groups that take most take at least `drop`."""
    whole, first = np.concatenate(groups, axis=1), 0
    for residual, factors in zip(search.best.fitted.residuals, _louder(search), strict=True):
        rows = len(residual)
        for factor in factors.T:
            part = np.fft.rfft(whole[first : first + rows], axis=0)
            whole[first : first + rows] = np.fft.irfft(part * factor[:, None], rows, axis=0)
            first += rows
    powers, turned = np.linalg.eigh(whole.T @ whole)
    root = (turned * np.sqrt(np.maximum(powers, 0.0))) @ turned.T
    drawn = np.random.default_rng(_seed(search.problem)).normal(size=(CHANCE_DRAWS, len(root))) @ root
    firsts = np.cumsum([0, *(each.shape[1] for each in groups[:-1])])
    taken = np.sort(np.add.reduceat(drawn**2, firsts, axis=1), axis=1)
    largest = np.sum(taken[:, -count:], axis=1)
    return float((1 + np.count_nonzero(largest >= drop)) / (CHANCE_DRAWS + 1))


def _bound(sizes: Sequence[int], drop: float, count: int) -> float:
    """Return Bonferroni's bound on the chance that some set of `count` groups takes at least `drop`."""
    if count == 1:
        return float(np.sum(scipy.special.chdtrc(sizes, drop)))
    lots = math.lgamma(len(sizes) + 1) - math.lgamma(count + 1) - math.lgamma(max(len(sizes) - count, 0) + 1)
    single = float(scipy.special.chdtrc(count * max(sizes), drop))
    return math.exp(min(lots + math.log(single), 0.0)) if single > 0.0 else 0.0


def _seed(problem: Problem) -> int:
    """Return a number that follows from the recordings, whatever their order."""
    columns = [
        hashlib.sha256(np.ascontiguousarray(each).tobytes()).hexdigest()
        for recording in problem.train
        for each in outputs_of(problem, recording).T
    ]
    return int(hashlib.sha256("".join(sorted(columns)).encode()).hexdigest()[:16], 16)
