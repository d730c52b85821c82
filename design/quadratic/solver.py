"""Find the moves of a law that solves, as its method does, in float64."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from firmloop.design.law import Solve, Tree
from firmloop.design.optimum import QuadraticSolver, Solution
from firmloop.design.quadratic.located import located
from firmloop.design.quadratic.splitting import swept

Array = npt.NDArray[np.float64]


def solver(stage: Solve, optimum: QuadraticSolver) -> Callable[[Array], Solution]:
    """Return the function from parameters (lanes, p) to their solution; `optimum` is that of a search."""
    if stage.method is None:
        return partial(optimum, stage.quadratic)
    if isinstance(stage.method, Tree):
        return partial(located, stage.method)
    return partial(swept, stage.method)
