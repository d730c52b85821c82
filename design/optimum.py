"""What solves a quadratic program for a design: the interface, and the Solution that it returns.

Design needs the optimum in float64 to judge a table of regions or a number of iterations, and to run a law that solves
in its loop; how it is found is no matter of design. The one search of the project is the twin of the C in
`quantize/twins/qp.py`, which stands above design: who calls design passes its `optimum`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Quadratic


@dataclass(frozen=True, slots=True)
class Solution:
    """The answers of a solver, a lane for every set of parameters.

    `side` is -1 where a row is at its low end, 1 at its high end, else 0; `work` is counted as the solver says.
    """

    moves: NDArray[Any]  # (lanes, k)
    status: NDArray[np.int64]  # (lanes,)
    work: NDArray[np.int64]  # (lanes,)
    side: NDArray[np.int64]  # (lanes, rows)


class QuadraticSolver(Protocol):
    """Find the optimum of a problem for every row of `parameters` (lanes, p), in float64."""

    def __call__(self, problem: Quadratic, parameters: NDArray[np.float64], /) -> Solution:
        """Return the moves; `status` is not SOLVED where there is no optimum or none was found."""
        ...
