"""Weigh what has no name: a term that follows some coordinate, by how likely it makes all recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.quantization import coarse
from firmloop.diagnose.discrepancy.disturbance_smoother import latent, nominal_plant
from firmloop.diagnose.discrepancy.terms import SENSOR, NamelessTerm, nameless_terms
from firmloop.diagnose.model.candidate import Candidate, rms_of, unlikely
from firmloop.diagnose.model.descent import residual_of, slopes_of, whitened
from firmloop.diagnose.model.fit import fit_starts, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, outputs_of
from firmloop.diagnose.policy import (
    DETERMINED_SHAPE,
    LIVE_COLUMN,
    LONG_MEMORY,
    MISSED_MOST,
    NEARER_SHAPE_SHARE,
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
from firmloop.identify.fitting.noise import Noise, flat
from firmloop.identify.fitting.projection import orthogonal, outside, with_starts
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Shape:
    """A term of one balance, or of one reading, that follows one coordinate.

    `gain` is the drop of BIC by `unknowns` hats or waves, on train and test, or what it is on test alone where the term
    makes those less likely: it then only follows a disturbance. `points` (b, 2) are the coordinate and the term there,
    in SI units; `train` and `test` the residuals (n, r) left by it and by the terms `beside` which it was weighed, and
    `left` the share of the rms of these terms' residuals that remains in the output that it explains best, on train or
    test, where that is more; 1 without test recordings.
    """

    balance: str
    coordinate: str
    unknowns: int
    gain: float
    points: Array
    train: tuple[Array, ...]
    test: tuple[Array, ...]
    beside: tuple[LibraryTerm, ...]
    left: float


@dataclass(frozen=True, slots=True)
class _Base:
    """An explanation that terms are added to, on the recordings of train and then of test.

    `own` are the slopes (n, r, k + s) of what may move along: its parameters, and the recording's initial state.
    """

    search: Search
    candidate: Candidate
    plant: Plant
    recordings: tuple[Recording, ...]
    point: Point
    residuals: tuple[Array, ...]
    own: tuple[Array, ...]

    @property
    def train(self) -> int:
        """How many recordings are of train."""
        return len(self.search.problem.train)


def outweighs(shape: Shape | None, noises: Sequence[Noise], explained: float) -> bool:
    """Tell whether a shape is too much beside the drop of BIC that named effects have brought, 0 of none.

    `noises` are what those leave. Where these foretell a drift, what is far off costs little: a shape by which
    simulations come twice as near, on unseen recordings too, is too much at a smaller share.
    """
    if shape is None:
        return False
    slow = all(len(noise.coefficients) >= LONG_MEMORY for noise in noises)
    some = shape.gain > (SLOW_SHAPE_GAIN if slow else SHAPE_GAIN)
    return some and shape.gain > (NEARER_SHAPE_SHARE if shape.left < MISSED_MOST else SHAPE_SHARE) * explained


def best_shape(search: Search, candidate: Candidate) -> Shape | None:
    """Return the term that makes the recordings most likely beside an explanation; None where none can be tested."""
    base = _base(search, candidate)
    sizes = [noise.rms for noise in candidate.noises]
    seen = [latent(base.plant, recording, sizes) for recording in base.recordings]
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
    if (
        candidate.fitted.terms
    ):  # else noise may hold most of what is missing, and no promise tells what it would give back
        choices = _promising(base, choices)
    bare = _weighed(base, ())
    without = min(bare[0], candidate.score), unlikely(base.search.problem, bare[2][base.train :])
    shapes = [_shape(base, term, *without) for term in choices]
    return max(shapes, key=lambda each: each.gain, default=None)


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
    unseen = fit_starts(problem, problem.test, fitted.point.values, candidate.noises)
    point = Point(fitted.point.values, (*fitted.point.starts, *unseen.starts))
    recordings = (*problem.train, *problem.test)
    left = tuple(residual_of(problem, recording, point, k) for k, recording in enumerate(recordings))
    own = [slopes_of(problem, each, fitted.coordinates, point, k, left[k]) for k, each in enumerate(recordings)]
    return _Base(search, candidate, nominal_plant(search, candidate), recordings, point, left, tuple(own))


def _moved(base: _Base, term: NamelessTerm, count: int) -> tuple[Array, ...]:
    """Return what a term does (n, r, b) to the first recordings."""
    found = []
    for k, recording in enumerate(base.recordings[:count]):
        each = np.nan_to_num(term.moved(base.plant, recording, k, base.train), posinf=0.0, neginf=0.0)
        if term.coordinate.pitch:  # of each recording's own size and phase
            wide = np.zeros((*each.shape[:2], each.shape[2] * len(base.recordings)))
            wide[..., k * each.shape[2] : (k + 1) * each.shape[2]] = each
            each = wide
        found.append(each)
    return tuple(found)


def _promising(base: _Base, choices: Sequence[NamelessTerm]) -> list[NamelessTerm]:
    """Pick the terms that promise most by the noise that is left, and those that do by white noise."""
    moved = [_moved(base, term, base.train) for term in choices]
    picked: list[int] = []
    for noises in (base.candidate.noises, flat(base.candidate.noises)):
        gains = _promised(base, moved, noises)
        picked += [int(place) for place in np.argsort(-gains)[:TRIED_SHAPES] if gains[place] > 0.0]
    return [choices[place] for place in dict.fromkeys(picked)]


def _promised(base: _Base, moved: Sequence[Sequence[Array]], noises: Sequence[Noise]) -> Array:
    """Return the drop (t,) of the whitened sum of squares by each term that nothing of the base can imitate."""
    basis = orthogonal(_stacked([_wide(base, k) for k in range(base.train)], noises))
    left = _stacked([each[..., None] for each in base.residuals[: base.train]], noises)[:, 0]
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
    """Return the slopes of one recording of train, with a place for the initial state of each."""
    return with_starts(base.own[index], len(base.candidate.fitted.coordinates), index, base.train)


def _weighed(base: _Base, moved: Sequence[Array], free: bool = False) -> tuple[float, Array, tuple[Array, ...]]:
    """Return BIC with a term (none where `moved` is empty), its unknowns (b,), and what it leaves of each recording.

    Its unknowns and the base's are fitted to train; on test only the initial states are, and what is `free`.
    """
    count = len(base.candidate.fitted.coordinates)
    terms = list(moved) or [np.zeros((*each.shape, 0)) for each in base.residuals]
    size = terms[0].shape[2]
    tall = [np.concatenate([terms[k], _wide(base, k)], axis=2) for k in range(base.train)]
    best = (np.inf, np.zeros(0), base.residuals)
    # A noise model may hold what the term would explain, and then hides it from the fit: so begin without one, too.
    begins = (base.candidate.noises, flat(base.candidate.noises))
    for noises in begins if moved else begins[:1]:
        for _ in range(SHAPE_ROUNDS):
            answer = _solved(tall, base.residuals[: base.train], noises)
            left = [residual - part @ answer for part, residual in zip(tall, base.residuals, strict=False)]
            shared = answer[: size + count]
            noises = noises_of(base.search.problem, left)
            for k in range(base.train, len(base.recordings)):
                rest = base.residuals[k] - np.concatenate([terms[k], base.own[k][..., :count]], axis=2) @ shared
                start = np.concatenate([base.own[k][..., count:], terms[k][..., : size if free else 0]], axis=2)
                left.append(rest - start @ _solved([start], [rest], noises))
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


def _score(base: _Base, left: Sequence[Array], unknowns: int) -> float:
    """Return BIC on train, and -2 log likelihood on test, as a candidate's score is made."""
    total = unlikely(base.search.problem, left[: base.train]) + unlikely(base.search.problem, left[base.train :])
    rows = sum(part.size for part in left[: base.train])
    return total + (len(base.candidate.fitted.coordinates) + unknowns) * float(np.log(rows))


def _shape(base: _Base, term: NamelessTerm, without: float, unseen: float) -> Shape:
    """Weigh a term by the score `without` it, and by -2 log likelihood of the test recordings without it, `unseen`."""
    moved = _moved(base, term, len(base.recordings))
    score, answer, left = _weighed(base, moved, term.coordinate.pitch > 0.0)
    centres = term.coordinate.centres(base.train)
    points = np.column_stack([centres, np.zeros(len(centres))])
    if not (term.coordinate.memory or term.coordinate.pitch):
        points[:, 1] = term.coordinate.shapes(centres, base.train) @ answer
    train, test = left[: base.train], left[base.train :]
    gain, seen = without - score, unseen - unlikely(base.search.problem, test)
    gain = min(gain, seen) if test and seen <= 0.0 else gain
    name, beside = term.coordinate.name, base.candidate.fitted.terms
    return Shape(term.kind, name, len(answer), gain, points, train, test, beside, _share_left(base, left))


def _share_left(base: _Base, left: Sequence[Array]) -> float:
    sides = (slice(None, base.train), slice(base.train, None))
    if not base.search.problem.test:
        return 1.0
    before, after = (np.array([rms_of(parts[side]) for side in sides]) for parts in (base.residuals, left))
    return float(np.min(np.max(after / np.maximum(before, 1e-300), axis=0)))
