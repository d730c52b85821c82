"""What an iteration of nonlinear predictive control needs beside the model, in its number format."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Horizon

Raw = NDArray[Any]

SOLVED, CAPPED, INFEASIBLE = 0, 1, 2
FAR = 1e30  # a step that nothing stops, and a limit that is none
MANY = 500  # sums at a time from which on each addend of all of them is one operation


@dataclass(frozen=True, slots=True)
class RtiCourse:
    """A problem in its number format; n states, m inputs, c states with limits.

    A row is violated beyond `tolerance` of its span (`weight` is one over that: of each input, then of each limited
    state); an answer counts where it is within `trusted` spans of optimal; a pivot below `least` of its first value
    depends on the active rows.
    """

    q: Raw  # (n, n)
    r: Raw  # (m, m)
    p: Raw  # (n, n)
    change: Raw  # (m,), the diagonal of S
    rest: Raw  # (m,)
    low: Raw  # (m + c,)
    high: Raw
    weight: Raw
    limited: tuple[int, ...]  # those c states
    length: int
    iterations: int
    budget: int  # pivots of one iteration
    tolerance: float
    trusted: float
    least: float

    @property
    def unknowns(self) -> int:
        """Moves of the whole horizon."""
        return self.length * len(self.r)

    @property
    def rows(self) -> int:
        """Limits of moves, then of states."""
        return self.unknowns + self.length * len(self.limited)


def course_of(problem: Horizon, kind: np.dtype[Any], tolerance: float, trusted: float, least: float) -> RtiCourse:
    """Round a problem to a number format."""
    low, high, weight = (np.clip(part, -FAR, FAR).astype(kind) for part in (problem.low, problem.high, problem.weight))
    return RtiCourse(
        problem.q.astype(kind), problem.r.astype(kind), problem.p.astype(kind), problem.change.astype(kind),
        problem.rest.astype(kind), low, high, weight, problem.limited, problem.length, problem.iterations,
        problem.budget, float(kind.type(tolerance)), float(kind.type(trusted)), float(kind.type(least)),
    )  # fmt: skip


def exact_course(problem: Horizon) -> RtiCourse:
    """Return a problem in float64, as its law means it."""
    return course_of(problem, np.dtype(np.float64), 2.0**-40, 2.0**-12, 2.0**-36)


def add_up(first: Raw, terms: Raw) -> Raw:
    """Return first (..., ) + terms (..., n), added one after the other, as C does."""
    if first.size < MANY:
        whole: Raw = np.add.accumulate(np.concatenate([first[..., None], terms], axis=-1), axis=-1)[..., -1]
        return whole
    whole = first
    for j in range(terms.shape[-1]):
        whole = whole + terms[..., j]
    return whole
