"""Tell a load that lasts from a slow disturbance: by how much its average differs from batch to batch.

The noise models of outputs are short: a disturbance of a moment's memory, integrated to a place, looks like a load to
them. Over batches far longer than its memory it averages out, and the means of batches tell how well (batch means;
Fishman, Management Science 24 (1978) 510-521).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import creeps, without
from firmloop.diagnose.model.fit import Fitted, deviations, noises_of, widened
from firmloop.diagnose.model.hypothesis import MOMENT, LibraryTerm, Problem
from firmloop.diagnose.model.sandwich_covariance import Sizes, batches, pushed, sizes_of, with_pushes
from firmloop.diagnose.policy import BATCHES, CHANCE_GAIN, LOAD_BY_CHANCE, PULL_BY_CHANCE, WITHIN_BATCHES
from firmloop.identify.fitting.noise import Noise, colored

Array = NDArray[np.float64]


def deviation(problem: Problem, fitted: Fitted, noises: Sequence[Noise], term: LibraryTerm) -> float:
    """Return the standard deviation of a load or an offset that slow disturbances leave it; 0 where none is told."""
    means = _means(problem, fitted, noises, term)
    if means is None:
        return 0.0
    moments = [fitted.point.values[key] for key in term.keys if key.endswith(MOMENT)]
    first = min(moments, default=-np.inf)
    late = np.concatenate([batches(recording, BATCHES) >= first for recording in problem.train])
    parts = [part for part in (np.sum(late), np.sum(~late)) if part]
    return float(np.std(np.concatenate(means), ddof=1) * np.sqrt(sum(1.0 / part for part in parts)))


def times_chance(problem: Problem, fitted: Fitted, noises: Sequence[Noise], term: LibraryTerm) -> float:
    """Return how many deviations by batches a load, an offset, a spring or a long wave is; infinite if untold."""
    pulls = term.effect.place == "torque" and not term.effect.lasting
    if pulls and creeps(term, fitted.point.values) and colored(noises):
        return _times_pull(problem, fitted, noises, term)
    value, spread = fitted.point.values[term.keys[0]], deviation(problem, fitted, noises, term)
    return abs(value) / spread if spread > 0.0 else np.inf


def _means(problem: Problem, fitted: Fitted, noises: Sequence[Noise], term: LibraryTerm) -> list[Array] | None:
    """Return the load, or offset, that is left in every batch of each recording; None where none is told."""
    if not term.effect.lasting or not colored(noises):
        return None
    found = []
    for index, residual in enumerate(fitted.residuals):
        told = _by_batches(problem, fitted, noises, term, index, (residual,))
        if told is None:
            return None
        found.append(told[0].sizes)
    return found


def _times_pull(problem: Problem, fitted: Fitted, noises: Sequence[Noise], term: LibraryTerm) -> float:
    """Return how many deviations an effect's loads by batches are; infinite where those are not what it does."""
    pulls, means = [], []
    bare = without(fitted, term)[1].values
    for index, recording in enumerate(problem.train):
        start = fitted.point.starts[index]
        values = (fitted.point.values, bare)
        one, other = (problem.engine.simulate(recording, each, start) for each in values)
        done = np.nan_to_num(one - other)
        found = _by_batches(problem, fitted, noises, term, index, (done, fitted.residuals[index]))
        if found is None or found[0].left > WITHIN_BATCHES:
            return np.inf
        pulls.append(found[0].sizes)
        means.append(found[1].sizes)
    spread = float(np.std(np.concatenate(means), ddof=1))
    return float(np.linalg.norm(np.concatenate(pulls))) / spread if spread > 0.0 else np.inf


def accidental(term: LibraryTerm, times: float, gain: float) -> bool:
    """Tell whether a term of so many deviations by batches may be no more than the average of a slow disturbance.

    `gain` is the drop of BIC it brought: where it is large, what batches differ by may be other physics.
    """
    return gain < CHANCE_GAIN and times < (LOAD_BY_CHANCE if term.effect.lasting else PULL_BY_CHANCE)


def by_chance(
    problem: Problem, fitted: Fitted, noises: Sequence[Noise], terms: Iterable[LibraryTerm], gain: float
) -> bool:
    """Tell whether one of the terms, which brought `gain` together, may be such an average."""
    return gain < CHANCE_GAIN and any(
        accidental(term, times_chance(problem, fitted, noises, term), gain) for term in terms
    )


def with_lasting(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Widen deviations of loads and offsets to what slow disturbances leave, of limits to what rounding does."""
    told = deviations(replace(fitted, wider=None))
    least = {
        term.keys[0]: max(deviation(problem, fitted, noises, term), _rounded(term))
        for term in fitted.terms
        if term.keys
    }
    factors = [
        least[each.name] / told[each.name] if each.name in least and told[each.name] > 0.0 else 1.0
        for each in fitted.coordinates
    ]
    return widened(fitted, np.array(factors))


def with_disturbances(problem: Problem, fitted: Fitted) -> Fitted:
    """Widen the deviations of a fit to what the slow disturbances that it leaves may have done to it."""
    noises = noises_of(problem, fitted.residuals)
    return with_lasting(problem, with_pushes(problem, fitted, noises), noises)


def _rounded(term: LibraryTerm) -> float:
    """Return the standard deviation that rounding leaves of the limit at which readings rest; 0 where none do.

    All are rounded alike there: no number of them tells more.
    """
    there = term.output is not None and term.effect.limits and term.scales.rested > 0.0
    return (term.scales.output - term.scales.rested) / float(np.sqrt(12.0)) if there else 0.0


def _by_batches(
    problem: Problem, fitted: Fitted, noises: Sequence[Noise], term: LibraryTerm, index: int, seen: Iterable[Array]
) -> list[Sizes] | None:
    """Return for each of `seen` (n, r) the load, or offset, of every batch that makes it, and the share it leaves."""
    begins = batches(problem.train[index], BATCHES)
    moves = pushed(problem, fitted, index, begins) if term.output is None else _offsets(problem, term, index, begins)
    return None if moves is None else sizes_of(problem, fitted, noises, index, moves, seen)


def _offsets(problem: Problem, term: LibraryTerm, index: int, begins: Array) -> Array:
    """Return what an offset of one in each batch alone does to the outputs (n, r, batches)."""
    rows = problem.train[index].time
    found = np.zeros((len(rows), len(problem.plant.outputs), len(begins)))
    batch = np.searchsorted(begins, rows, side="right") - 1
    found[np.arange(len(rows)), [signal.name for signal in problem.plant.outputs].index(str(term.output)), batch] = 1.0
    return found
