"""Simulate what was left out of a fit: blocks of all recordings of train in turn, or whole ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import creeps
from firmloop.diagnose.model.fit import beside_scale, fit, fit_starts
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import (
    CROSS_FIT_PATIENCE,
    CROSS_FOLDS,
    CROSS_PATIENCE,
    FEWEST_ROWS,
    STEPS_OF_A_NEAR_FIT,
)
from firmloop.identify.fitting.noise import Noise, white
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Contender:
    """Terms with the values that a refit begins from, those of the plant among them, and where recordings began.

    `starts` are by the id of a recording: of motion that is told by a hair, as over the crests of a wave, the values
    alone do not tell the course.
    """

    terms: tuple[LibraryTerm, ...]
    values: Mapping[str, float]
    starts: Mapping[int, Array]


@dataclass(frozen=True, slots=True)
class _Fold:
    """What a fit sees: `rest`, of a recording that is hidden in part all but these rows; else all but `left_out`."""

    rest: tuple[Recording, ...]
    left_out: tuple[Recording, ...]
    hidden: Mapping[int, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What is left of rows that a fit did not see: `figures` {output: {explanation: rms}}, in the outputs' units.

    `residuals` by explanation are measured - simulated (n, r), part by part.
    """

    figures: Mapping[str, Mapping[str, float]]
    residuals: Mapping[str, tuple[Array, ...]]


def left_out(problem: Problem, explanations: Mapping[str, Contender], sizes: Sequence[float]) -> LeftOut:
    """Simulate what is left out of a fit.

    Each explanation is fitted again to the rest by plain simulation error, from where it ended, and simulates what was
    left out from its input alone; the initial state is fitted, too. `before` is the plant as given, not fitted.
    `sizes` (r,) weigh the outputs. A rest that no longer makes certain what all recordings do is no test. No fold
    begins after a number of simulated steps; nothing is told where a recording is too short to be cut, or a simulation
    diverges.
    """
    engine, noises = problem.engine, [white(size) for size in sizes]
    until = engine.steps + CROSS_PATIENCE
    known = {name: _certain_of(problem, problem.train, each, noises, 0)[1] for name, each in explanations.items()}
    given = {p.name: p.value for p in problem.plant.parameters}
    lefts: dict[str, list[Array]] = {name: [] for name in ("before", *explanations)}
    # What creeps may be how one run differs from the next, which blocks of all do not tell.
    slow = any(creeps(term, each.values) for each in explanations.values() for term in each.terms)
    for fold in _folds(problem, slow):
        if engine.steps > until:
            break
        part = replace(problem, train=fold.rest, test=(), memory={}, hidden=fold.hidden)
        fitted: dict[int, tuple[Mapping[str, float], set[str]]] = {}
        for each in explanations.values():
            if id(each) not in fitted:  # the plain refit may stand for the explanation, too
                fitted[id(each)] = _certain_of(part, fold.rest, each, noises, STEPS_OF_A_NEAR_FIT)
        if any(known[name] - fitted[id(each)][1] for name, each in explanations.items()):
            continue
        lefts["before"] += _missed(problem, fold, Contender((), given, {}), noises)
        for name, each in explanations.items():
            lefts[name] += _missed(problem, fold, replace(each, values=fitted[id(each)][0]), noises)
    found: dict[str, dict[str, float]] = {}
    for name, parts in lefts.items():
        if not parts:
            continue
        power = np.mean(np.concatenate(parts) ** 2, axis=0)
        for signal, each in zip(problem.plant.outputs, power, strict=True):
            if np.isfinite(each):
                found.setdefault(signal.name, {})[name] = float(np.sqrt(each))
    return LeftOut(found, {name: tuple(parts) for name, parts in lefts.items()})


def _folds(problem: Problem, whole: bool) -> list[_Fold]:
    """Return what is left out in turn: all blocks of recordings but the first, or `whole` ones where one is short."""
    train, blocks = tuple(problem.train), CROSS_FOLDS + 1  # the first tells where all begins
    rows = [len(each.time) for each in train]
    if min(rows) >= blocks * FEWEST_ROWS and (len(train) == 1 or not whole):
        ends = [[k * count // blocks for k in range(1, blocks + 1)] for count in rows]
        cuts = zip(*(pairwise(own) for own in ends), strict=True)
        return [_Fold(train, train, {id(each): cut for each, cut in zip(train, own, strict=True)}) for own in cuts]
    if len(train) == 1:
        return []
    lots = np.array_split(np.arange(len(train)), min(len(train), CROSS_FOLDS))
    return [
        _Fold(
            tuple(each for k, each in enumerate(train) if k not in lot),
            tuple(each for k, each in enumerate(train) if k in lot),
            {},
        )
        for lot in lots
    ]


def _certain_of(
    part: Problem, rest: tuple[Recording, ...], each: Contender, noises: Sequence[Noise], steps: int
) -> tuple[Mapping[str, float], set[str]]:
    """Return the values of an explanation fitted to the rest in some steps, and which of them that makes certain."""
    begin = fit_starts(part, rest, each.values, noises, each.starts)
    fitted = fit(part, rest, each.terms, begin, noises, steps, CROSS_FIT_PATIENCE)
    values = fitted.point.values
    spread = beside_scale(fitted)
    return values, {name for name, size in spread.items() if abs(values.get(name, 0.0)) > NORMAL_95 * size}


def _missed(problem: Problem, fold: _Fold, each: Contender, noises: Sequence[Noise]) -> list[Array]:
    """Return measured - simulated (n, r) of what was left out; an initial state is fitted to what is not hidden."""
    part = replace(problem, train=fold.left_out, test=(), memory={}, hidden=fold.hidden)
    point = fit_starts(part, fold.left_out, each.values, noises, each.starts)
    whole = replace(part, hidden={})
    lefts = [residual_of(whole, recording, point, k) for k, recording in enumerate(fold.left_out)]
    return [left[slice(*fold.hidden.get(id(own), (0, None)))] for own, left in zip(fold.left_out, lefts, strict=True)]
