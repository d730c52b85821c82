"""Unroll a reading that wraps once more, by what explains the rest: at first nothing was known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.unwrap import shifted, turns_between
from firmloop.diagnose.model.candidate import Candidate, unseen_residuals
from firmloop.diagnose.model.fit import fit, noises_of
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.model.slopes import slopes_of
from firmloop.diagnose.policy import COUNTED_MOST, COUNTED_NEAR, COUNTING_ROUNDS, RANGE_DEVIATIONS, STEPS_OF_A_FIT
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.noise import flat
from firmloop.identify.plants.effects import effect_seen_by
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


def regauged(found: Search, train: Sequence[Recording], test: Sequence[Recording]) -> Problem | None:
    """Return the problem with how often readings wrapped, and every range, as the best explanation tells it.

    None where it tells the same. `train` and `test` are the recordings as they were read, before they were unrolled.
    """
    given, best = found.problem, found.best
    problem = given
    for number, direct in enumerate(given.direct):
        if direct.effect != effect_seen_by("wraps").name:
            continue
        index = [signal.name for signal in problem.plant.outputs].index(direct.output)
        for _ in range(COUNTING_ROUNDS):
            counted = _recounted(problem, best, (*train, *test), index, direct.values[0])
            if counted is None:
                break
            problem = counted
            fitted = fit(
                problem, problem.train, best.fitted.terms, best.fitted.point, flat(best.noises), STEPS_OF_A_FIT
            )
            best = Candidate(fitted, noises_of(problem, fitted.residuals), best.score)
        turns = [
            turns_between(before, after, direct.output, direct.values[0])
            for before, after in zip((*train, *test), (*problem.train, *problem.test), strict=True)
        ]
        off, deviation = _off(problem, best, index, turns[: len(train)])
        if abs(off) > RANGE_DEVIATIONS * deviation:
            values, deviations = (direct.values[0] + off, direct.values[1]), (deviation, direct.deviations[1])
            known = replace(direct, values=values, deviations=deviations)
            directs = (*problem.direct[:number], known, *problem.direct[number + 1 :])
            problem = replace(_moved(problem, direct.output, [off * turn for turn in turns]), direct=directs)
    return None if problem is given else problem


def _recounted(problem: Problem, best: Candidate, raw: Sequence[Recording], index: int, reach: float) -> Problem | None:
    """Return the problem with readings moved by as many ranges as brings each near an explanation.

    None where none is to be moved, or the explanation is not near most of them even so.
    """
    output = problem.plant.outputs[index].name
    residuals = (*best.fitted.residuals, *unseen_residuals(problem, best.fitted, best.noises))
    changes, near = [], []
    for before, after, residual in zip(raw, (*problem.train, *problem.test), residuals, strict=True):
        simulated = after.columns[output] - residual[:, index]
        unrolled = before.columns[output] + reach * np.round((simulated - before.columns[output]) / reach)
        near.append(np.abs(unrolled - simulated) < COUNTED_NEAR * reach)
        changes.append(reach * np.round((unrolled - after.columns[output]) / reach))
    if not any(np.any(change) for change in changes) or float(np.mean(np.concatenate(near))) < COUNTED_MOST:
        return None
    return _moved(problem, output, changes)


def _moved(problem: Problem, output: str, changes: Sequence[Array]) -> Problem:
    """Return the problem with changes (n,) of an output's readings in every recording."""
    whole = [
        shifted(each, output, change) for each, change in zip((*problem.train, *problem.test), changes, strict=True)
    ]
    count = len(problem.train)
    return replace(problem, train=tuple(whole[:count]), test=tuple(whole[count:]), memory={})


def _off(problem: Problem, best: Candidate, index: int, turns: Sequence[Array]) -> tuple[float, float]:
    """Return by how much the range of output `index` is too small, and the deviation of that, beside all unknowns."""
    sizes = np.array([noise.rms for noise in best.noises])
    count = len(best.fitted.coordinates)
    tall, left = [], []
    for k, (recording, residual, turn) in enumerate(zip(problem.train, best.fitted.residuals, turns, strict=True)):
        slopes = slopes_of(problem, recording, best.fitted.coordinates, best.fitted.point, k, residual)[..., :count]
        own = np.zeros((*residual.shape, 1))
        own[:, index, 0] = -turn
        tall.append((np.concatenate([own, slopes], axis=2) / sizes[:, None]).reshape(residual.size, -1))
        left.append((residual / sizes).ravel())
    columns = np.concatenate(tall)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    answer = np.linalg.lstsq(columns / scale, np.concatenate(left), rcond=1e-9)[0] / scale
    spread = np.sqrt(np.diag(np.linalg.pinv((columns / scale).T @ (columns / scale), rcond=1e-12))) / scale
    return float(answer[0]), float(spread[0])
