"""Screen all terms at once: how much of what is left over each could explain that no nominal parameter can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import unlikely
from firmloop.diagnose.model.fit import Fitted
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, waved
from firmloop.diagnose.model.slopes import residual_of, slopes_of, whitened
from firmloop.diagnose.policy import LINEAR_SHARE, OPPOSITE_SIZE, PARALLEL, SCREEN_PATIENCE, SMALL_GRID
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.fitting.projection import outside, turn, with_starts
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]
Secants = Sequence[Sequence[Array]]  # what a term changes (n, r) of every recording; of a wave, and a quarter turn on


@dataclass(frozen=True, slots=True)
class Screened:
    """A term with the drop of the whitened sum of squares it promises, and the start that promises most.

    `left` is the share of the term's trace that the nominal parameters cannot imitate, `shrunk` that of the size it was
    simulated with which the start has: far below one, its trace is not that of the start.
    """

    term: LibraryTerm
    gain: float
    start: Mapping[str, float]
    left: float
    shrunk: float = 1.0
    drop: float = 0.0  # of -2 log likelihood once the noise is estimated anew


class Order(NamedTuple):
    """Waves per turn of cogging or ripple, or the moment (s) of a load step, and the size it seems to have."""

    choice: float
    size: float


@dataclass(frozen=True, slots=True)
class Ground:
    """What a screen projects on, under one noise model: the base's slopes as a basis, and what they leave over."""

    noises: tuple[Noise, ...]
    basis: Array  # (rows, k)
    left: Array  # (rows,)
    within: Array  # (k,) what the basis has of the whitened residuals
    slopes: tuple[Array, ...]  # (n, r, k) of every recording, not whitened, in the order of the basis
    residuals: tuple[Array, ...]  # (n, r) of every recording
    problem: Problem
    evidence: float  # -2 log likelihood of the residuals, at best after a last step of the base's unknowns


def ground(problem: Problem, recordings: Sequence[Recording], base: Fitted, noises: Sequence[Noise]) -> Ground:
    """Whiten slopes and residuals of the base, and take out of the residuals what its own unknowns can still do."""
    tangents, lefts, raw = [], [], []
    count = len(base.coordinates)
    for k, recording in enumerate(recordings):
        slopes = slopes_of(problem, recording, base.coordinates, base.point, k, base.residuals[k])
        parts = with_starts(slopes, count, k, len(recordings))
        raw.append(parts)
        tangents.append(whitened(parts, noises))
        lefts.append(whitened(base.residuals[k], noises))
    turned = turn(np.concatenate(tangents))
    basis = np.concatenate(tangents) @ turned
    left = np.concatenate(lefts)
    own = tuple(part @ turned for part in raw)
    within = basis.T @ left
    refined = [part - slopes @ within for part, slopes in zip(base.residuals, own, strict=True)]
    said = min(unlikely(problem, residuals) for residuals in (base.residuals, refined))
    return Ground(tuple(noises), basis, outside(basis, left), within, own, base.residuals, problem, said)


def screen(
    problem: Problem,
    recordings: Sequence[Recording],
    base: Fitted,
    terms: Sequence[LibraryTerm],
    grounds: Sequence[Ground],
    orders: Mapping[str, Sequence[Order]],
) -> tuple[tuple[Screened, ...], ...]:
    """Project secants (simulated with the term - without) on what each ground leaves; best first, ground by ground.

    `orders` are the waves per turn or the moments worth a simulation, by the effect's name, with the size they seem to
    have: a wave far larger moves the shaft past its own crests. Where there is none, all.
    """
    found: list[list[Screened]] = [[] for _ in grounds]
    for term in terms:
        best: list[tuple[Screened, Secants] | None] = [None for _ in grounds]
        begun = problem.engine.steps
        for start in _promising(term, problem.starts[term.label], orders.get(term.effect.name, ())):
            if problem.engine.steps - begun > SCREEN_PATIENCE:
                break
            best = _better(best, term, start, secants(problem, recordings, base, term, start), grounds)
        again = [each[0].start for each in best if each is not None and each[0].shrunk < LINEAR_SHARE]
        for start in [start for k, start in enumerate(again) if start not in again[:k]]:
            best = _better(best, term, start, secants(problem, recordings, base, term, start), grounds)
        for table, each, under in zip(found, best, grounds, strict=True):
            if each is not None:
                judged, traced = each
                table.append(replace(judged, drop=_drop(traced, under)) if judged.gain > 0.0 else judged)
    return tuple(tuple(sorted(each, key=lambda one: -one.gain)) for each in found)


def _better(
    best: Sequence[tuple[Screened, Secants] | None],
    term: LibraryTerm,
    start: Mapping[str, float],
    traced: Secants,
    grounds: Sequence[Ground],
) -> list[tuple[Screened, Secants] | None]:
    """Return the best of each ground: what it was, or the term at a start with what it changes."""
    found = []
    for held, under in zip(best, grounds, strict=True):
        judged = _judge(term, start, traced, under)
        found.append(held if judged is None or (held is not None and held[0].gain >= judged.gain) else (judged, traced))
    return found


def _promising(
    term: LibraryTerm, starts: Sequence[Mapping[str, float]], orders: Sequence[Order]
) -> list[Mapping[str, float]]:
    """Keep of a grid over waves per turn, or over moments, those asked for, phase zero."""
    grids = (".periods_per_rev", ".time_s")
    key = next((key for start in starts for key in start if key.endswith(grids)), None)
    asked: list[Mapping[str, float]] = []
    for one in orders:
        size, most = term.keys[0], starts[0][term.keys[0]]
        asked.append({**starts[0], **({key: one.choice} if key else {}), size: min(one.size, most) or most})
    if asked or key:
        return asked or list(starts)
    phase = next((key for start in starts for key in start if key.endswith(".phase_rad")), None)
    return [start for start in starts if phase is None or start[phase] == starts[0][phase]]


def every_start(problem: Problem, screened: Screened) -> Sequence[Mapping[str, float]]:
    """Return all starts of a term; of a large grid, which was searched when it was screened, the one it promised."""
    starts = problem.starts[screened.term.label]
    return starts if len(starts) <= SMALL_GRID else (screened.start,)


def secants(
    problem: Problem, recordings: Sequence[Recording], base: Fitted, term: LibraryTerm, start: Mapping[str, float]
) -> Secants:
    """Return what the term changes (n, r), per recording; a wave also a quarter turn on: phase needs no grid."""
    turned = {key: value + 0.5 * np.pi for key, value in start.items() if key.endswith(".phase_rad")}
    found = []
    for change in [dict(start), {**start, **turned}] if turned else [dict(start)]:
        parts = []
        for k, recording in enumerate(recordings):
            point = Point(entered(base.point.values, term, change), base.point.starts)
            parts.append(base.residuals[k] - residual_of(problem, recording, point, k))
        found.append(tuple(parts))
    return tuple(found)


def _drop(secants: Secants, under: Ground) -> float:
    """Take out of the residuals what a term and the base's unknowns can do, and see how likely the rest is.

    The noise that the base has left over holds the trace of the term, which whitens it away.
    """
    tall = np.stack([np.concatenate([whitened(part, under.noises) for part in parts]) for parts in secants], axis=1)
    pure = outside(under.basis, tall)
    shares = np.linalg.pinv(pure.T @ pure, rcond=1e-13, hermitian=True) @ (pure.T @ under.left)
    own = under.within - under.basis.T @ (tall @ shares)
    rest = []
    for k, residual in enumerate(under.residuals):
        moved = np.stack([parts[k] for parts in secants], axis=2) @ shares
        rest.append(residual - moved - under.slopes[k] @ own)
    return under.evidence - unlikely(under.problem, rest)


def _judge(term: LibraryTerm, start: Mapping[str, float], secants: Secants, under: Ground) -> Screened | None:
    if not all(np.all(np.isfinite(part)) for parts in secants for part in parts):
        return None
    tall = np.stack([np.concatenate([whitened(part, under.noises) for part in parts]) for parts in secants], axis=1)
    sizes = np.linalg.norm(tall, axis=0)
    pure = outside(under.basis, tall)
    rest = np.linalg.norm(pure, axis=0)
    live = rest > PARALLEL * np.maximum(sizes, 1e-300)
    share = float(rest[0] / max(sizes[0], 1e-300))
    if not np.any(live):
        return Screened(term, 0.0, start, share)
    axis, _ = np.linalg.qr(pure[:, live])
    gain = float(np.sum((axis.T @ under.left) ** 2))
    size = start.get(term.keys[0], 0.0) if term.parameters and term.parameters[0].neutral == 0.0 else 0.0
    if size and not term.effect.screened:  # no share of what it changes is what less of it does
        return Screened(term, max(float(pure[:, 0] @ (2.0 * under.left - pure[:, 0])), 0.0), start, share)
    if len(secants) == 1 and float(pure[:, 0] @ under.left) < 0.0 and not _signed(term):
        # The data wants the opposite of what physics allows, or far less of it.
        begin, less = (_times(term, start, OPPOSITE_SIZE), OPPOSITE_SIZE) if size else (start, 1.0)
        return Screened(term, 0.01 * gain, begin, share, less)
    if size == 0.0 or not np.all(live):
        return Screened(term, gain, start, share)
    shares = np.asarray(np.linalg.lstsq(pure, under.left, rcond=None)[0], dtype=np.float64)
    begin = waved(term, start, shares) if len(secants) == 2 else _shrunk(term, start, float(shares[0]))
    return Screened(term, gain, begin, share, begin[term.keys[0]] / size)


def _shrunk(term: LibraryTerm, start: Mapping[str, float], share: float) -> Mapping[str, float]:
    """Return a start of the size that a share of it tells, no larger than it is."""
    return _times(term, start, min(share, 1.0)) if share > 0.0 else start


def _times(term: LibraryTerm, start: Mapping[str, float], share: float) -> Mapping[str, float]:
    """Return a start of a share of its size."""
    return {**start, term.keys[0]: start[term.keys[0]] * share}


def _signed(term: LibraryTerm) -> bool:
    """Tell whether the first parameter may have either sign."""
    return not term.parameters or term.parameters[0].low < term.parameters[0].neutral
