"""Tell what each recording has of its own beside an explanation, and how well it is known."""

from __future__ import annotations

import numpy as np

from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, fit_starts, inverse
from firmloop.diagnose.model.hypothesis import Point, Problem
from firmloop.identify.fitting.own_values import OwnValue, own_value


def own_of_all(problem: Problem, fitted: Fitted) -> tuple[OwnValue, ...]:
    """Return the values of all recordings; of a test recording beside the parameters as they were found."""
    values = fitted.point.values
    if not problem.plant.varying:
        return ()
    plant = problem.plant.valued(values)
    count, states = len(fitted.coordinates), len(problem.engine.states)
    spread = np.sqrt(np.maximum(np.diag(inverse(fitted.normal))[count:], 0.0)).reshape(-1, states)
    known = [*zip(problem.train, fitted.point.starts, spread, strict=True)]
    for recording, start in zip(
        problem.test, fit_starts(problem, problem.test, values, fitted.noises).starts, strict=True
    ):
        squares = SumOfSquares(problem, [recording], (), fitted.noises, np.zeros((0, 1)))
        normal = squares.normal(squares.slopes(squares.at(Point(values, (start,))), None))
        known.append((recording, start, np.sqrt(np.maximum(np.diag(inverse(normal)), 0.0))))
    return tuple(
        OwnValue(recording.source, own_value(plant, one, start, float(deviation[one.state])))
        for recording, start, deviation in known
        for one in plant.varying
    )
