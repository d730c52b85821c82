"""Choose the points a fit starts from."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.experiment import Experiment, misfit
from firmloop.identify.fitting.least_squares import triangle
from firmloop.identify.plants.kinds import find_kind
from firmloop.identify.plants.operating_point import OUTPUT
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import Engine

Array = NDArray[np.float64]

_KEPT = 3  # of the grid; distinct basins are few in plants of one or two time constants
_SPREAD = 3.0  # factor by which a nameplate value may be off before the basin of the fit is in danger
_SEED = 20240229  # any; fixed, so that a fit repeats


def starting_points(plant: Plant, simulator: Engine, experiments: Sequence[Experiment]) -> tuple[Array, ...]:
    """Return parameter vectors (k,), the most promising first.

    Where values are missing, a grid of shapes is scored: the output is linear in the kind's scale, in the level that it
    rests at and in the initial state, so that these follow by linear least squares. Where all are given, they are the
    first start and the others lie around it (Latin hypercube over the logarithms of the free ones).
    """
    given = np.array([parameter.value for parameter in plant.parameters])
    if np.any(np.isnan(given)):
        return _scored_grid(plant, simulator, experiments, given)
    free = [index for index, p in enumerate(plant.parameters) if p.free and p.value != 0.0]
    if not free:
        return (given,)
    rng = np.random.default_rng(_SEED)
    count = 3
    cells = np.stack([rng.permutation(count) for _ in free], axis=1)
    places = 2.0 * (cells + rng.random(cells.shape)) / count - 1.0
    starts = [given]
    for place in places:
        start = given.copy()
        start[free] *= _SPREAD**place
        starts.append(np.clip(start, [p.low for p in plant.parameters], [p.high for p in plant.parameters]))
    return tuple(starts)


def _scored_grid(plant: Plant, simulator: Engine, experiments: Sequence[Experiment], given: Array) -> tuple[Array, ...]:
    kind = find_kind(plant.kind)
    names = [parameter.name for parameter in plant.parameters]
    step = min(made.course.step for made in experiments)
    span = max(float(made.course.time[-1] - made.course.time[0]) for made in experiments)
    level = [k for k, each in enumerate(plant.parameters) if each.name == OUTPUT and each.free]
    scored: dict[tuple[float, ...], float] = {}
    for shape in kind.shapes(step, span):
        constants = np.array([shape.get(name, math.nan) for name in names])
        constants = np.where(np.isnan(given), constants, given)
        bounded = [min(max(value, p.low), p.high) for value, p in zip(constants, plant.parameters, strict=True)]
        constants = np.array(bounded)
        scale = [names.index(kind.scale)] if kind.scale is not None and np.isnan(constants).any() else []
        constants, cost = _scaled(simulator, experiments, constants, (*scale, *level), bool(scale))
        scored.setdefault(tuple(constants.tolist()), cost)
    best = sorted((cost, constants) for constants, cost in scored.items() if math.isfinite(cost))
    return tuple(np.array(constants) for _, constants in itertools.islice(best, _KEPT))


def _scaled(
    simulator: Engine, experiments: Sequence[Experiment], constants: Array, linear: Sequence[int], scaled: bool
) -> tuple[Array, float]:
    """Find what the output is linear in, the constants `linear` and the initial states; return constants and cost.

    The first of `linear` is the scale where `scaled`.
    """
    trial = constants.copy()
    states, levels = simulator.states, list(linear[scaled:])
    trial[list(linear[:scaled])] = 0.0  # what is left then is no answer to the input
    rows = []
    for made in experiments:
        residual, slopes = misfit(made, simulator, trial, np.zeros(states), levels)
        columns = [-slopes[..., len(levels) :], -slopes[..., : len(levels)]]
        if scaled:
            moved = trial.copy()
            moved[linear[0]] = 1.0
            answer, own = misfit(made, simulator, moved, np.zeros(states), ())
            columns = [-own, (residual - answer)[..., None], columns[1]]
        if not all(np.all(np.isfinite(each)) for each in (residual, *columns)):
            return trial, math.inf
        tall = [each.reshape(residual.size, each.shape[-1]) for each in (*columns, residual[..., None])]
        # Below the rows of the initial state stands what no initial state can explain.
        rows.append(triangle(*tall)[states:, states:])
    below = np.concatenate(rows)
    found = np.linalg.lstsq(below[:, :-1], below[:, -1], rcond=None)[0]
    trial[list(linear)] += found
    return trial, float(np.sum((below[:, -1] - below[:, :-1] @ found) ** 2))
