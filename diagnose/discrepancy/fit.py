"""Weigh what has no name: a term that follows some coordinate, by how likely it makes all recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.quantization import coarse
from firmloop.diagnose.discrepancy.coordinates import Curve
from firmloop.diagnose.discrepancy.locate import as_others, nominal_plant
from firmloop.diagnose.discrepancy.terms import SENSOR, NamelessTerm, nameless_terms
from firmloop.diagnose.model.candidate import Candidate, rms_of, unlikely
from firmloop.diagnose.model.disturbance_smoother import latent
from firmloop.diagnose.model.fit import noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, outputs_of
from firmloop.diagnose.model.slopes import residual_of, slopes_of, whitened
from firmloop.diagnose.policy import (
    CHANCE_GAIN,
    CROSS_FOLDS,
    DETERMINED_SHAPE,
    LIVE_COLUMN,
    LONG_MEMORY,
    SHAPE_GAIN,
    SHAPE_ROUNDS,
    SHAPE_SHARE,
    SLOW_SHAPE_GAIN,
    TRIED_SHAPES,
)
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.search.round import screened
from firmloop.diagnose.search.screen import Screened, secants
from firmloop.identify.fitting.least_squares import triangle
from firmloop.identify.fitting.noise import Noise, plain_too
from firmloop.identify.fitting.projection import orthogonal, outside, with_starts
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Shape:
    """A term of one balance, or of one reading, that follows one coordinate.

    `gain` is the drop of BIC by `unknowns` hats or waves. `points` (b, 2) are the coordinate and the term there, in SI
    units; `residuals` (n, r) what is left by it and by the terms `beside` which it was weighed.
    """

    balance: str
    coordinate: str
    unknowns: int
    gain: float
    points: Array
    residuals: tuple[Array, ...]
    beside: tuple[LibraryTerm, ...]


@dataclass(frozen=True, slots=True)
class _Base:
    """An explanation that terms are added to, on the recordings.

    `own` are the slopes (n, r, k + s) of what may move along: its parameters, and the recording's initial state.
    """

    search: Search
    candidate: Candidate
    plant: Plant
    recordings: tuple[Recording, ...]
    point: Point
    residuals: tuple[Array, ...]
    own: tuple[Array, ...]


def outweighs(shape: Shape | None, noises: Sequence[Noise], explained: float) -> bool:
    """Tell whether a shape is too much beside the drop of BIC that named effects have brought, 0 of none.

    `noises` are what those leave.
    """
    if shape is None:
        return False
    slow = all(len(noise.coefficients) >= LONG_MEMORY for noise in noises)
    some = shape.gain > (SLOW_SHAPE_GAIN if slow else SHAPE_GAIN)
    return some and shape.gain > SHAPE_SHARE * explained


def best_shape(search: Search, candidate: Candidate) -> Shape | None:
    """Return the term that makes the recordings most likely beside an explanation; None where none can be tested."""
    base = _base(search, candidate)
    sizes = [noise.rms for noise in candidate.noises]
    point = base.point
    shared = [
        as_others(search, each, point.values, start) for each, start in zip(base.recordings, point.starts, strict=True)
    ]
    seen = [latent(base.plant, recording, sizes) for recording in shared]
    found = [each for each in seen if each is not None]
    if len(found) < len(seen) or not all(np.all(np.isfinite(left)) for left in base.residuals):
        return None
    simulated = [
        outputs_of(search.problem, each) - left for each, left in zip(base.recordings, base.residuals, strict=True)
    ]
    steps = {each.output for each in coarse(base.plant, search.problem.train, sizes)}
    choices = [
        term
        for term in nameless_terms(base.plant, base.recordings, found, simulated, base.residuals)
        if term.kind != SENSOR or base.plant.outputs[term.place].name not in steps
    ]
    if candidate.fitted.terms:
        # Else noise may hold most of what is missing, and no promise tells what it would give back.
        choices = _promising(base, choices)
    bare = _weighed(base, ())
    without = min(bare[0], candidate.score)
    one_of_each = {(term.kind, term.place): term for term in choices if term.coordinate.level}
    levels = {where: _by_chance(base, term, without) for where, term in one_of_each.items()}
    shapes = [
        (_shape(base, term, levels[term.kind, term.place] if term.coordinate.level else without), term)
        for term in choices
    ]
    for each, term in sorted(shapes, key=lambda pair: -pair[0].gain):
        # What only whitens what is left, or follows these very rows, is no law of a machine.
        if np.any(rms_of(each.residuals) < rms_of(base.residuals)) and _foresees(base, term, each):
            return each
    return None


def _by_chance(base: _Base, term: NamelessTerm, without: float) -> float:
    """Return the score with a constant in the term's place, `without` one where that is more than there is by chance.

    A disturbance has a mean, and no law is needed for it.
    """
    nowhere = tuple(np.zeros_like(values) for values in term.coordinate.values)
    constant = replace(term, coordinate=Curve("constant", nowhere))
    score = _weighed(base, _moved(base, constant))[0]
    return score if 0.0 < without - score < CHANCE_GAIN else without


def weighed(search: Search) -> tuple[Screened, ...]:
    """Screen all terms beside the best explanation by how likely each makes all recordings, best first.

    The noise is estimated anew twice, so that a term is seen that the noise left over whitens away.
    """
    problem, base = search.problem, _base(search, search.best)
    fitted = replace(search.best.fitted, point=base.point, residuals=base.residuals)
    without = min(_weighed(base, ())[0], search.best.score)
    found = []
    for each in screened(problem, search.best):
        parts = secants(problem, base.recordings, fitted, each.term, each.start)
        moved = [np.stack([part[k] for part in parts], axis=2) for k in range(len(base.recordings))]
        if all(np.all(np.isfinite(part)) for part in moved):
            found.append(replace(each, gain=max(without - _weighed(base, moved)[0], each.gain)))
    return tuple(sorted(found, key=lambda each: -each.gain))


def _base(search: Search, candidate: Candidate) -> _Base:
    problem, fitted = search.problem, candidate.fitted
    recordings, point = problem.train, fitted.point
    left = tuple(residual_of(problem, recording, point, k) for k, recording in enumerate(recordings))
    own = [slopes_of(problem, each, fitted.coordinates, point, k, left[k]) for k, each in enumerate(recordings)]
    return _Base(search, candidate, nominal_plant(search, candidate), recordings, point, left, tuple(own))


def _moved(base: _Base, term: NamelessTerm) -> tuple[Array, ...]:
    """Return what a term does (n, r, b) to the recordings."""
    found = []
    for k, recording in enumerate(base.recordings):
        each = np.nan_to_num(term.moved(base.plant, recording, k), posinf=0.0, neginf=0.0)
        if term.coordinate.own:  # of each recording's own size and phase
            wide = np.zeros((*each.shape[:2], each.shape[2] * len(base.recordings)))
            wide[..., k * each.shape[2] : (k + 1) * each.shape[2]] = each
            each = wide
        found.append(each)
    return tuple(found)


def _promising(base: _Base, choices: Sequence[NamelessTerm]) -> list[NamelessTerm]:
    """Pick the terms that promise most by the noise that is left, and those that do by white noise."""
    moved = [_moved(base, term) for term in choices]
    picked: list[int] = []
    for noises in plain_too(base.candidate.noises):
        gains = _promised(base, moved, noises)
        picked += [int(place) for place in np.argsort(-gains)[:TRIED_SHAPES] if gains[place] > 0.0]
    return [choices[place] for place in dict.fromkeys(picked)]


def _promised(base: _Base, moved: Sequence[Sequence[Array]], noises: Sequence[Noise]) -> Array:
    """Return the drop (t,) of the whitened sum of squares by each term that nothing of the base can imitate."""
    basis = orthogonal(_stacked([_wide(base, k) for k in range(len(base.recordings))], noises))
    left = _stacked([each[..., None] for each in base.residuals], noises)[:, 0]
    left = outside(basis, left)
    gains = []
    for parts in moved:
        tall = _stacked(parts, noises)
        pure = outside(basis, tall)
        live = np.linalg.norm(pure, axis=0) > LIVE_COLUMN * np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
        gain = float(np.sum((orthogonal(pure[:, live]).T @ left) ** 2)) if np.any(live) else 0.0
        gains.append(gain - float(np.sum(live)) * np.log(len(left)))
    return np.array(gains)


def _stacked(parts: Sequence[Array], noises: Sequence[Noise]) -> Array:
    return np.concatenate([whitened(part, noises) for part in parts])


def _wide(base: _Base, index: int) -> Array:
    """Return the slopes of one recording, with a place for the initial state of each."""
    return with_starts(base.own[index], len(base.candidate.fitted.coordinates), index, len(base.recordings))


def _weighed(base: _Base, moved: Sequence[Array]) -> tuple[float, Array, tuple[Array, ...]]:
    """Return BIC with a term (none where `moved` is empty), its unknowns (b,), and what it leaves of each recording."""
    terms = list(moved) or [np.zeros((*each.shape, 0)) for each in base.residuals]
    size = terms[0].shape[2]
    tall = [np.concatenate([terms[k], _wide(base, k)], axis=2) for k in range(len(base.recordings))]
    best = (np.inf, np.zeros(0), base.residuals)
    # A noise model may hold what the term would explain, and then hides it from the fit: so begin without one, too.
    begins = plain_too(base.candidate.noises)
    for noises in begins if moved else begins[:1]:
        for _ in range(SHAPE_ROUNDS):
            answer = _solved(tall, base.residuals, noises)
            left = [residual - part @ answer for part, residual in zip(tall, base.residuals, strict=True)]
            noises = noises_of(base.search.problem, left)
            score = _score(base, left, size)
            if score < best[0]:
                best = (score, answer[:size], tuple(left))
    return best


def _solved(tall: Sequence[Array], residuals: Sequence[Array], noises: Sequence[Noise]) -> Array:
    """Return the least squares answer (c,) to whitened residuals (n, r) by columns (n, r, c)."""
    whole = [np.concatenate([part, left[..., None]], axis=2) for part, left in zip(tall, residuals, strict=True)]
    small = triangle(_stacked(whole, noises))
    sizes = np.linalg.norm(small[:, :-1], axis=0)
    sizes[sizes == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(small[:, :-1] / sizes, small[:, -1], rcond=DETERMINED_SHAPE)[0] / sizes)


def _foresees(base: _Base, term: NamelessTerm, shape: Shape) -> bool:
    """Tell whether a term foresees what is left out of its fit: recordings in turn, or blocks of each.

    Blocks where there is but one, or where every recording has its own size of the term.
    """
    noises = noises_of(base.search.problem, shape.residuals)
    moved, free = _moved(base, term), len(base.candidate.fitted.coordinates)
    whole = [
        whitened(np.concatenate([moved[k], _wide(base, k), base.residuals[k][..., None]], axis=2), noises)
        for k in range(len(base.recordings))
    ]
    rows = np.concatenate(whole)
    if len(whole) > 1 and not term.coordinate.own:
        recording = np.repeat(np.arange(len(whole)), [len(part) for part in whole])
        lots = [recording == k for k in range(len(whole))]
        begins = rows[:, shape.unknowns + free : -1]  # where a recording began is fitted to its own rows
    else:
        blocks = [
            np.tile(np.arange(n) * (CROSS_FOLDS + 1) // n, len(part) // n)
            for part, n in ((part, len(each.time)) for part, each in zip(whole, base.recordings, strict=True))
        ]
        lots = [np.concatenate(blocks) == k for k in range(1, CROSS_FOLDS + 1)]
        begins = np.zeros((len(rows), 0))
    gain = 0.0
    for out in lots:
        basis = orthogonal(begins[out])
        for first, sign in ((0, -1.0), (shape.unknowns, 1.0)):
            some = rows[:, first:]
            sizes = np.linalg.norm(some[~out, :-1], axis=0)
            sizes[sizes == 0.0] = 1.0
            answer = np.linalg.lstsq(some[~out, :-1] / sizes, some[~out, -1], rcond=DETERMINED_SHAPE)[0] / sizes
            gain += sign * float(np.sum(outside(basis, some[out, -1] - some[out, :-1] @ answer) ** 2))
    return gain > 0.0


def _score(base: _Base, left: Sequence[Array], unknowns: int) -> float:
    """Return BIC, as a candidate's score is made."""
    rows = sum(part.size for part in left)
    return unlikely(base.search.problem, left) + (len(base.candidate.fitted.coordinates) + unknowns) * float(
        np.log(rows)
    )


def _shape(base: _Base, term: NamelessTerm, without: float) -> Shape:
    """Weigh a term by the score `without` it."""
    moved = _moved(base, term)
    score, answer, left = _weighed(base, moved)
    score += term.coordinate.searched * float(np.log(sum(part.size for part in left)))
    points = term.coordinate.law(answer)
    name, beside = term.coordinate.name, base.candidate.fitted.terms
    return Shape(term.kind, name, len(answer), without - score, points, left, beside)
