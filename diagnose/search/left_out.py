"""Simulate what was left out of a fit: recordings of train in turn, or blocks of the only one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.descent import residual_of
from firmloop.diagnose.model.fit import fit, fit_starts
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem
from firmloop.diagnose.policy import (
    CROSS_FIT_PATIENCE,
    CROSS_FOLDS,
    CROSS_PATIENCE,
    FEWEST_ROWS,
    STEPS_OF_A_NEAR_FIT,
)
from firmloop.identify.fitting.noise import white
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Contender:
    """Terms with the values that a refit begins from, those of the plant among them."""

    terms: tuple[LibraryTerm, ...]
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class _Fold:
    rest: tuple[Recording, ...]
    left_out: tuple[Recording, ...]


def left_out_rms(
    problem: Problem, explanations: Mapping[str, Contender], sizes: Sequence[float]
) -> dict[str, dict[str, float]]:
    """Return {output: {explanation: rms}} of measured - simulated where it was left out, in the outputs' units.

    Each explanation is fitted again to the rest by plain simulation error, from where it ended, and simulates what was
    left out from its input alone; the initial state is fitted. `before` is the plant as given, which is not fitted.
    `sizes` (r,) weigh the outputs. No fold begins after a number of simulated steps; nothing is told where a recording
    is too short to be cut, or a simulation diverges.
    """
    engine, strayed = problem.engine, dict(problem.engine.strayed)
    folds, own = _folds(problem)
    engine.amend({**strayed, **own})
    until = engine.steps + CROSS_PATIENCE
    given = {p.name: p.value for p in problem.plant.parameters}
    lefts: dict[str, list[Array]] = {name: [] for name in ("before", *explanations)}
    for fold in folds:
        if engine.steps > until:
            break
        lefts["before"] += _missed(problem, fold.left_out, given, sizes)
        known: dict[int, list[Array]] = {}
        for name, each in explanations.items():
            if id(each) not in known:  # the plain refit may stand for the explanation, too
                known[id(each)] = _missed(problem, fold.left_out, _refitted(problem, fold.rest, each, sizes), sizes)
            lefts[name] += known[id(each)]
    engine.amend(strayed)
    found: dict[str, dict[str, float]] = {}
    for name, parts in lefts.items():
        if not parts:
            continue
        power = np.mean(np.concatenate(parts) ** 2, axis=0)
        for signal, each in zip(problem.plant.outputs, power, strict=True):
            if np.isfinite(each):
                found.setdefault(signal.name, {})[name] = float(np.sqrt(each))
    return found


def _folds(problem: Problem) -> tuple[list[_Fold], dict[int, Array]]:
    """Return what is left out in turn, and how far the recorded angles of new parts are known to have strayed."""
    train = problem.train
    if len(train) > 1:
        lots = np.array_split(np.arange(len(train)), min(len(train), CROSS_FOLDS))
        return [
            _Fold(
                tuple(each for k, each in enumerate(train) if k not in lot),
                tuple(each for k, each in enumerate(train) if k in lot),
            )
            for lot in lots
        ], {}
    (whole,) = train
    rows = len(whole.time)
    if rows < CROSS_FOLDS * FEWEST_ROWS:
        return [], {}
    ends = [k * rows // CROSS_FOLDS for k in range(CROSS_FOLDS + 1)]
    folds: list[_Fold] = []
    own: dict[int, Array] = {}
    for first, end in pairwise(ends):
        places = [place for place in ((0, first), (end, rows)) if place[0] < place[1]]
        parts = [whole.part(*place) for place in (*places, (first, end))]
        if id(whole) in problem.engine.strayed:
            angles = problem.engine.strayed[id(whole)]
            own |= {
                id(part): angles[low:high] for part, (low, high) in zip(parts, (*places, (first, end)), strict=True)
            }
        folds.append(_Fold(tuple(parts[:-1]), tuple(parts[-1:])))
    return folds, own


def _refitted(
    problem: Problem, rest: tuple[Recording, ...], each: Contender, sizes: Sequence[float]
) -> Mapping[str, float]:
    """Return the values of an explanation that was fitted to the rest alone."""
    noises = [white(size) for size in sizes]
    part = replace(problem, train=rest, test=(), memory={})
    begin = fit_starts(part, rest, each.values, noises)
    return fit(part, rest, each.terms, begin, noises, STEPS_OF_A_NEAR_FIT, CROSS_FIT_PATIENCE).point.values


def _missed(
    problem: Problem, left_out: tuple[Recording, ...], values: Mapping[str, float], sizes: Sequence[float]
) -> list[Array]:
    """Return measured - simulated (n, r) of each recording, only its initial state fitted."""
    part = replace(problem, train=left_out, test=(), memory={})
    point = fit_starts(part, left_out, values, [white(size) for size in sizes])
    return [residual_of(part, recording, point, k) for k, recording in enumerate(left_out)]
