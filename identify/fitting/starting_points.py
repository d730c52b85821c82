"""Choose the points a fit starts from."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.experiment import Experiment, misfit
from firmloop.identify.fitting.least_squares import triangle
from firmloop.identify.fitting.problem import LEASH, FitProblem, loosened, shortened
from firmloop.identify.plants.kinds import find_kind, kinds
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import Engine

Array = NDArray[np.float64]

_KEPT = 3  # of the grid; distinct basins are few in plants of one or two time constants
_SPREAD = 3.0  # factor by which a nameplate value may be off before the basin of the fit is in danger
_STRAIGHT = 1e-6  # of how far outputs move: less is rounding
_PIECES = 100  # of a recording, over which a change is seen
_OF_THE_GRID = 16.0  # of the longest delay of a grid: the least share of it that is tried
_SHARES = 9  # each twice the one before
_SEED = 20240229  # any; fixed, so that a fit repeats


def starting_points(plant: Plant, simulator: Engine, experiments: Sequence[Experiment]) -> tuple[Array, ...]:
    """Return parameter vectors (k,), the most promising first.

    Where values are missing, a grid of shapes is scored: the output is linear in the kind's scale, in the level that it
    rests at and in the initial state, so that these follow by linear least squares. Where all are given, they are the
    first start and others lie around it (Latin hypercube over the logarithms of the free ones); the last is the best of
    the grid, for what swings quicker than two rows tell follows them as well as what they tell, to a look.
    """
    given = np.array([parameter.value for parameter in plant.parameters])
    names = [parameter.name for parameter in plant.parameters]
    near = _near(plant, simulator, experiments)
    if near is not None:
        bare = unguided(plant)
        more = bare is not None and np.sum(np.isnan([p.value for p in bare.parameters])) > np.sum(np.isnan(given))
        return (*near, *(starting_points(bare, simulator, experiments)[:1] if bare is not None and more else ()))
    step = min(made.course.step for made in experiments)
    span = max(float(made.course.time[-1] - made.course.time[0]) for made in experiments)
    shapes = find_kind(plant.kind).shapes(step, span)
    shapes = (*shapes, *_late(plant, shapes, experiments))
    grid = [np.array([shape.get(name, math.nan) for name in names]) for shape in shapes]
    return _scored(plant, simulator, experiments, [np.where(np.isnan(given), shape, given) for shape in grid])


def _near(plant: Plant, simulator: Engine, experiments: Sequence[Experiment]) -> tuple[Array, ...] | None:
    """Return the points (k,) around the values as given; None where more of them than scale and level are missing."""
    given = np.array([parameter.value for parameter in plant.parameters])
    missing = {parameter.name for parameter in plant.parameters if math.isnan(parameter.value)}
    if not missing <= set(scale_and_level(plant)):
        return None
    around = _around(plant, given)
    return _scored(plant, simulator, experiments, around) if missing else around


def _late(
    plant: Plant, shapes: Sequence[Mapping[str, float]], experiments: Sequence[Experiment]
) -> list[Mapping[str, float]]:
    """Return shapes whose delay is beyond those of a kind's grid, where the output follows the input so late.

    An input that changes often leaves a valley for each of its changes, and no way from one to the next. The lag at
    which output and input are most alike holds part of the plant's own lag too, which comes off in several shares.
    """
    if plant.delay is None or len(plant.inputs) != 1 or any(plant.delay not in shape for shape in shapes):
        return []
    longest = max(shape[plant.delay] for shape in shapes)
    late = float(np.median([_most_alike(made) for made in experiments]))
    if late <= longest:
        return []
    slow = longest / _OF_THE_GRID
    delays = [late, *(late - slow * 2.0**k for k in range(_SHARES) if slow * 2.0**k < late)]
    bare = {tuple(sorted({**shape, plant.delay: 0.0}.items())): shape for shape in shapes}
    return [{**shape, plant.delay: delay} for shape in bare.values() for delay in delays]


def _most_alike(made: Experiment) -> float:
    """Return by how much an output follows the input where the changes of both are most alike, of either sign, s."""
    rows, size = max(len(made.measured) // _PIECES, 1), 2 * len(made.measured)
    drive = made.course.drive[made.course.end - len(made.measured) : made.course.end, 0]
    one, other = (np.fft.rfft(each[rows:] - each[:-rows], size) for each in (made.measured[:, 0], drive))
    across = np.fft.irfft(one * np.conj(other), size)[: len(drive)]
    return float(np.argmax(np.abs(across))) * made.course.step


def without_far_values(problem: FitProblem, steps: Sequence[float]) -> FitProblem:
    """Return the problem without those values of scale and level that the recordings lie beyond the leash of.

    They follow from the data by linear least squares, so that no start is needed, and a far one would only hold the fit
    back. Not where an effect keeps the output from being linear in them. `steps` as for `shortened`.
    """
    plant, simulator = problem.plant, problem.engine
    given = np.array([parameter.value for parameter in plant.parameters])
    linear = [k for k, p in enumerate(plant.parameters) if p.name in scale_and_level(plant) and p.free and p.value]
    if not linear or np.all(np.isnan(given[linear])):
        return problem
    experiments = shortened(problem, steps).experiments
    bare = plant.valued({plant.parameters[k].name: math.nan for k in linear})
    for found in (_near(bare, simulator, experiments) or starting_points(bare, simulator, experiments))[:1]:
        far = [k for k in linear if abs(found[k] - given[k]) > LEASH * abs(given[k])]
        if far and _is_linear(simulator, experiments, found, linear):
            return loosened(problem, plant.valued({plant.parameters[k].name: math.nan for k in far}))
    return problem


def unguided(plant: Plant) -> Plant | None:
    """Return the plant without those free values that its kind can guess; None where it can guess none.

    A start value that is far off may lead a fit astray where one from the recordings would not.
    """
    kind = kinds().get(plant.kind)
    if kind is None or kind.scale is None:
        return None
    guessed = {each.name for each in kind.constants if each.guessable}
    return plant.valued({p.name: math.nan for p in plant.parameters if p.free and p.name in guessed})


def scale_and_level(plant: Plant) -> tuple[str, ...]:
    """Return the names of the scale and the level of the plant's kind, as far as it has them."""
    kind = kinds().get(plant.kind)
    return () if kind is None else tuple(filter(None, (kind.scale, kind.level)))


def _is_linear(simulator: Engine, experiments: Sequence[Experiment], constants: Array, which: Sequence[int]) -> bool:
    """Tell whether the outputs at 0, 1 and 2 times constants[which] lie on one line."""
    for made in experiments:
        runs = []
        for factor in (0.0, 1.0, 2.0):
            moved = constants.copy()
            moved[list(which)] *= factor
            runs.append(simulator.run(made.course, moved, np.zeros(simulator.states)))
        bend, reach = runs[2] - 2.0 * runs[1] + runs[0], runs[1] - runs[0]
        if not np.linalg.norm(bend) <= _STRAIGHT * np.linalg.norm(reach):
            return False
    return True


def _around(plant: Plant, given: Array) -> tuple[Array, ...]:
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


def _scored(
    plant: Plant, simulator: Engine, experiments: Sequence[Experiment], shapes: Sequence[Array]
) -> tuple[Array, ...]:
    """Return the best of shapes (k,), whose scale and level follow from the data where they have none."""
    kind = find_kind(plant.kind)
    scale = [k for k, each in enumerate(plant.parameters) if each.name == kind.scale]
    level = [k for k, each in enumerate(plant.parameters) if each.name == kind.level and each.free]
    scored: dict[tuple[float, ...], float] = {}
    for shape in {each.tobytes(): each for each in shapes}.values():
        bounded = [min(max(value, p.low), p.high) for value, p in zip(shape, plant.parameters, strict=True)]
        constants = np.array(bounded)
        constants[level] = np.nan_to_num(constants[level])
        open_scale = [k for k in scale if np.isnan(constants[k])]
        constants, cost = _scaled(simulator, experiments, constants, (*open_scale, *level), bool(open_scale))
        scored.setdefault(tuple(constants.tolist()), cost)
    best = sorted((cost, constants) for constants, cost in scored.items() if math.isfinite(cost))
    if not best:
        raise IdentifyError(
            "no simulation of the plant stays finite, from all start values tried: a value in [plant.parameters] is "
            "far too large for these recordings; check its exponent and its unit"
        )
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
