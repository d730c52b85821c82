"""Begin where the plant was given: a refit may have run far away to hide what is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate, extended, farther, joined, rated
from firmloop.diagnose.model.equation_error import leads
from firmloop.diagnose.model.fit import Fitted, fit, fit_starts, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, first_point
from firmloop.diagnose.model.lost_sign import from_unfolded
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import (
    CLOSER_RMS,
    FIRM_TO_RUN_AWAY,
    LOST_PARAMETER,
    MOST_EFFECTS,
    MOVED_FAR,
    ROUND_PATIENCE,
    RUN_AWAY,
    SIGNLESS_NOISE,
    STEPS_FROM_GIVEN,
    STEPS_OF_A_FIT,
    STEPS_OF_A_START,
    STEPS_OF_A_TRIAL,
    TRIED_FROM_GIVEN,
)
from firmloop.diagnose.search.orders import best_orders
from firmloop.diagnose.search.screen import Screened, every_start, ground, screen
from firmloop.identify.fitting.fit import about_means
from firmloop.identify.fitting.noise import colored, flat, oversized, white
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE

Array = NDArray[np.float64]


def from_given(problem: Problem, candidate: Candidate, table: Sequence[Screened]) -> tuple[Fitted, ...]:
    """Try the terms that help most beside the parameters as given: a refit may have run far away to hide one.

    Beside effects that were found, what has not run away stays. `table` are the terms as screened: a stop that a refit
    never comes to leaves no trace there, and is tried as well.
    """
    sizes, found = flat(candidate.noises), candidate.fitted
    told, folded, left = set[str](), set[str](), False
    if found.terms:
        away = runaways(problem, found, LOST_PARAMETER)
        lost, begin = bool(away), Point({**found.point.values, **away}, found.point.starts)
    else:
        folded = {term.label for term in problem.terms if _folded(problem, term)}
        told = folded | {one.term.label for one in table if one.term.effect.touches and one.left == 0.0}
        ran, left = _ran_away(problem, candidate) if colored(candidate.noises) else (False, False)
        lost = bool(folded) or ran
        begin = first_point(problem, problem.train)
    if not lost and not told:
        return ()
    given = fit(problem, problem.train, found.terms, begin, sizes, 0)
    under = [ground(problem, problem.train, given, sizes)]
    others = [term for term in problem.terms if term not in found.terms]
    (screened,) = screen(problem, problem.train, given, others, under, best_orders(problem, given, under))
    picked = [one for k, one in enumerate(screened) if (lost and k < TRIED_FROM_GIVEN) or one.term.label in told]
    begun = [extended(given, one.term, one.start) for one in picked]
    if left:
        begun += [(near.terms, near.point) for near in _nearest(problem, given, screened)]
    tried = [fit(problem, problem.train, *each, sizes, STEPS_FROM_GIVEN) for each in begun]
    return (*tried, *(from_unfolded(problem, term) for term in others if term.label in folded))


def _nearest(problem: Problem, given: Fitted, table: Sequence[Screened]) -> list[Fitted]:
    """Return the terms of a table that come nearest in a few steps, each from the best of its starts.

    What a stiff spring holds goes far without it: its trace beside the plant as given foretells next to nothing, and a
    refit that has left the motion altogether tells as little.
    """
    until = problem.engine.steps + ROUND_PATIENCE
    found: dict[str, Fitted] = {}
    for each in table:
        for start in every_start(problem, each):
            if problem.engine.steps < until:
                one = fit(problem, problem.train, *extended(given, each.term, start), given.noises, STEPS_OF_A_START)
                if one.cost < (found[each.term.label].cost if each.term.label in found else math.inf):
                    found[each.term.label] = one
    return sorted(found.values(), key=lambda each: each.cost)[:TRIED_FROM_GIVEN]


def from_means(problem: Problem, nominal: Candidate) -> tuple[Fitted, ...]:
    """Fit the level of an output from where a fit of all deviations from their means ends, if a sign is another there.

    Beside a level that is not the plant's, a refit may not come to the sign of a gain.
    """
    signed = any(p.free and p.low < 0.0 < p.high for p in problem.plant.parameters)
    if nominal.fitted.terms or not signed or not _misfit(problem, nominal):
        return ()
    centred, known = about_means(problem.plant, problem.train, NONE), nominal.fitted.point.values
    if centred is None or not any(p.value * known[p.name] < 0.0 for p in centred.parameters if p.free):
        return ()
    begin = first_point(problem, problem.train)
    values = {**begin.values, **{p.name: p.value for p in centred.parameters}}
    sizes = flat(nominal.noises)
    bare = fit(problem, problem.train, (), Point(values, begin.starts), sizes, 0)
    levels = np.mean(np.concatenate(bare.residuals), axis=0)
    found = []
    for signal, level in zip(problem.plant.outputs, levels, strict=True):
        for term in problem.terms:
            if term.effect.lasting and term.output == signal.name:
                terms, point = extended(bare, term, {term.keys[0]: float(level)})
                begun = fit_starts(problem, problem.train, point.values, sizes)
                found.append(fit(problem, problem.train, terms, begun, sizes, STEPS_FROM_GIVEN))
    return tuple(found)


def from_balance(problem: Problem, nominal: Candidate) -> tuple[Fitted, ...]:
    """Fit what a regression of the balance makes of the motion, where the nominal plant misses what is no noise.

    More terms at once only where fewer do not come near: one by one is how all else is found.
    """
    if nominal.fitted.terms or not _misfit(problem, nominal):
        return ()
    begins = leads(problem, sensor_noises(nominal.fitted.residuals, problem.floors))
    found: list[Fitted] = []
    for count in range(1, MOST_EFFECTS + 1):
        least = CLOSER_RMS**2 * min((each.cost for each in found), default=math.inf)
        tried = [
            fit(problem, problem.train, terms, point, flat(nominal.noises), STEPS_FROM_GIVEN)
            for terms, point in begins
            if len(terms) == count
        ]
        found += [each for each in tried if each.cost < least]
    return tuple(found)


def _misfit(problem: Problem, candidate: Candidate) -> bool:
    """Tell whether what a candidate leaves is taken for no noise, or is larger than that may be."""
    return problem.samples > 0.0 or oversized(candidate.noises)


def _folded(problem: Problem, term: LibraryTerm) -> bool:
    """Tell whether a reading is never negative where the plant as given would go both ways."""
    if term.effect.seen_by != "folds" or term.output is None:
        return False
    index = [signal.name for signal in problem.plant.outputs].index(term.output)
    begin = first_point(problem, problem.train)
    for k, recording in enumerate(problem.train):
        values = recording.columns[term.output]
        ours = values - residual_of(problem, recording, begin, k)[:, index]
        top = float(values.max())
        if float(values.min()) < -SIGNLESS_NOISE * top or not float(np.nanmin(ours)) < -10.0 * SIGNLESS_NOISE * top:
            return False
    return True


def _ran_away(problem: Problem, nominal: Candidate) -> tuple[bool, bool]:
    """Tell whether a refit has moved a parameter far from where it was given, which is firm here or was there.

    And whether it was firm there alone: where a refit leaves a motion altogether, as of a shaft too heavy to turn,
    nothing tells its parameters any more.
    """
    found, begin = nominal.fitted, first_point(problem, problem.train)
    moves = [
        each.inner(found.point.values[each.name]) - each.inner(begin.values[each.name]) for each in found.coordinates
    ]
    moved = [k for k, each in enumerate(found.coordinates) if each.logarithmic and abs(moves[k]) > MOVED_FAR]
    if not moved:
        return False, False
    there = fit(problem, problem.train, (), begin, flat(nominal.noises), 0)
    firm = [any(each.normal[k, k] * FIRM_TO_RUN_AWAY**2 > 1.0 for k in moved) for each in (found, there)]
    return any(firm), firm[1] and not firm[0]


def runaways(problem: Problem, fitted: Fitted, factor: float = RUN_AWAY) -> dict[str, float]:
    """Return the values as given of free nominal parameters that a fit has moved by a factor from there.

    An inertia that terms have taken a part of has not gone with it.
    """
    values, found = fitted.point.values, {}
    for p in problem.plant.parameters:
        taken = sum(
            values[term.taken[0]] for term in fitted.terms if term.taken is not None and term.taken[1] == p.name
        )
        if p.free and p.value > 0.0 and not 1.0 / factor < (values[p.name] + taken) / p.value < factor:
            found[p.name] = p.value
    return found


def afresh(problem: Problem, base: Fitted, screened: Screened) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Add a term, all of them from their grids and the plant as given: what ran away without it may not come back."""
    terms, _ = joined(base, screened.term)
    begin = first_point(problem, problem.train)
    values: Mapping[str, float] = begin.values
    for term in terms:
        grid = problem.starts[term.label]
        values = entered(values, term, grid[len(grid) // 2] if grid else {})
    return terms, Point(values, begin.starts)


def nominal_fit(problem: Problem, refit: Plant | None) -> Candidate:
    """Fit the nominal plant from where `identify` ends with white noise, then with the noise it left over."""
    begin = first_point(problem, problem.train)
    known = {p.name: p.value for p in refit.parameters} if refit else {}
    spread = [np.std(np.concatenate([outputs for outputs in column])) for column in _columns(problem)]
    whole = [white(max(float(size), float(floor), 1e-12)) for size, floor in zip(spread, problem.floors, strict=True)]
    trials = [
        fit(problem, problem.train, (), each, whole, STEPS_OF_A_TRIAL * 2)
        for each in (begin, Point({**begin.values, **known}, begin.starts))
    ]
    fitted = min(trials, key=lambda each: each.cost if math.isfinite(each.cost) else math.inf)
    for _ in range(2):
        fitted = fit(
            problem, problem.train, (), fitted.point, flat(noises_of(problem, fitted.residuals)), STEPS_OF_A_FIT
        )
    fits = [rated(problem, fitted)]
    for _ in range(3):
        last = fits[-1]
        fits.append(rated(problem, fit(problem, problem.train, (), last.fitted.point, last.noises, STEPS_OF_A_FIT)))
    return with_likelier(fits)


def with_likelier(fits: Sequence[Candidate]) -> Candidate:
    """Return the likeliest of some fits of the same effects that simulate no farther off than the first of them does.

    With it a likelier one that does, which may have made noise of the motion, or leaves to a drift what is its.
    """
    near = min((each for each in fits if not farther(each, fits[0])), key=lambda each: each.score)
    likeliest = min((each.likeliest for each in fits), key=lambda each: each.score)
    return replace(near, likelier=likeliest if likeliest.score < near.score else None)


def _columns(problem: Problem) -> list[list[Array]]:
    return [[recording.columns[signal.name] for recording in problem.train] for signal in problem.plant.outputs]
