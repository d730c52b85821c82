"""Find the moves of a law that solves, as its method does, in float64."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from design.active_set import Solution, exact, solve
from design.law import Solve, Tree
from design.located import located
from design.splitting import swept

Array = npt.NDArray[np.float64]


def solver(stage: Solve) -> Callable[[Array], Solution]:
    """Return the function from parameters (lanes, p) to their solution."""
    if stage.method is None:
        return partial(solve, exact(stage.quadratic))
    if isinstance(stage.method, Tree):
        return partial(located, stage.method)
    return partial(swept, stage.method)
