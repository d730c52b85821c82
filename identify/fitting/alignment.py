"""Fit clock differences together with everything else: alone, each is mistaken for a little of a plant's slowness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.experiment import Experiment, conditioned, delayed, not_simulated
from firmloop.identify.fitting.least_squares import scaled_step
from firmloop.identify.fitting.problem import FitPoint, FitProblem, weighted

Array = NDArray[np.float64]

_DETERMINED = 1e-12  # of the best determined direction: less is not moved along
_STEP = 0.05  # rows, of the difference quotient


def lag_slopes(problem: FitProblem, point: FitPoint) -> list[Array]:
    """Return per experiment the slopes (q, r, l) of the weighted residuals for the lags of its l aligned outputs."""
    found = []
    for made, start in zip(problem.experiments, point.starts, strict=True):
        if not made.lags:
            found.append(np.zeros((*made.target.shape, 0)))
            continue
        outputs = problem.engine.run(made.course, point.constants, start)
        columns = [_lag_slope(made, outputs, name) for name in made.lags]
        found.append(np.stack(columns, axis=2) * problem.weights[:, None])
    return found


def _lag_slope(made: Experiment, outputs: Array, name: str) -> Array:
    """Return by how much the residuals (q, r) rise for a second more of lag; rows without a value have none."""
    late, step = made.lags[name], _STEP * made.course.step
    later = late + step
    rise = delayed(made, outputs) - delayed(replace(made, lags={**made.lags, name: later}), outputs)
    rise[not_simulated(made, late) | not_simulated(made, later)] = 0.0
    return conditioned(made, rise) / step


def lag_steps(problem: FitProblem, point: FitPoint, recordings: Sequence[Sequence[int]]) -> list[Array]:
    """Return by how much (l,) the lags of each recording are off, by one Gauss-Newton step of all unknowns together.

    `recordings` lists the experiments of each.
    """
    pairs, lags = list(weighted(problem, point)), lag_slopes(problem, point)
    count, states = len(problem.free), point.starts.shape[1]
    late = lags[0].shape[2]
    width = count + states * len(pairs) + late * len(recordings)
    square, pulled = np.zeros((width, width)), np.zeros(width)
    for index, ((residual, slopes), own) in enumerate(zip(pairs, lags, strict=True)):
        group = next(k for k, members in enumerate(recordings) if index in members)
        first = count + states * len(pairs) + late * group
        places = [*range(count), *range(count + states * index, count + states * (index + 1))]
        places += range(first, first + late)
        tall = np.concatenate([slopes, own], axis=2).reshape(residual.size, -1)
        square[np.ix_(places, places)] += tall.T @ tall
        pulled[places] -= tall.T @ residual.reshape(-1)
    step, _ = scaled_step(square, pulled, _DETERMINED)
    begin = count + states * len(pairs)
    return [step[begin + late * k : begin + late * (k + 1)] for k in range(len(recordings))]
