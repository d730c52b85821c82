"""Find every region of a quadratic program's parameters in which one set of limits acts, and its moves.

Where the active set is known, multipliers and rows are affine in the parameters; the region is where the multipliers
have their signs and the other rows keep their limits (Bemporad, Morari, Dua and Pistikopoulos, Automatica 38, 2002).
Regions are found by walking: from each facet of one, a little outward, the optimum of that point tells the next. Where
there is none, the facet is one of the border of all parameters that have an optimum, a convex set.

Everything stands in parameters t from -1 to 1, over the box that the law declares.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.law import DesignError, Quadratic
from firmloop.design.optimum import QuadraticSolver
from firmloop.design.outcome import INFEASIBLE, SOLVED

Array = npt.NDArray[np.float64]

MOST = 400  # regions; beyond it a search is smaller, and finding them takes minutes
MOST_PARAMETERS = 6  # corners of a region grow with 2 to their power
THIN = 1e-6  # a region this thin, or a step outward, in t
FLAT = 1e-9  # a constraint that no parameter moves
SAME = 1e-9  # two planes, or two laws over the range of their moves
CORNERS = 6  # of a facet, near which a step outward is tried beside its middle


@dataclass(frozen=True, slots=True)
class Region:
    """One region: its planes a t <= b, which of these are on the outer border, its corners, and its moves' law."""

    planes: Array  # (facets, p + 1): a, then -b
    outer: npt.NDArray[np.bool_]  # (facets,)
    corners: Array  # (n, p)
    law: Array  # (k, p + 1): the moves are law (t, 1)


def partition(problem: Quadratic, middle: Array, half: Array, optimum: QuadraticSolver) -> list[Region]:
    """Return the regions within the box `middle` +- `half`, each (p,); the first is that where no limit acts.

    Raises
    ------
    DesignError
        when there are more than MOST regions, or too many parameters.
    """
    if len(middle) > MOST_PARAMETERS:
        raise DesignError(
            f"controller.solver = 'explicit' cuts the space of {len(middle)} parameters (states, references, last "
            f"outputs, disturbances) into regions; at most {MOST_PARAMETERS} can be cut: leave some out, or use "
            'solver = "online"'
        )
    return _Walk(problem, middle, half, optimum).regions()


class _Walk:
    """The regions found so far, by their active set."""

    def __init__(self, problem: Quadratic, middle: Array, half: Array, optimum: QuadraticSolver) -> None:
        self.problem, self.middle, self.half, self.optimum = problem, middle, half, optimum
        size = max(2, len(middle))  # a line is cut as a strip
        self.slope = np.zeros((len(problem.low), size))
        self.slope[:, : len(middle)] = problem.slope * half
        self.offset = problem.slope @ middle
        self.box = np.hstack([np.vstack([np.eye(size), -np.eye(size)]), np.full((2 * size, 1), -1.0)])
        self.found: dict[bytes, Region] = {}

    def regions(self) -> list[Region]:
        random = np.random.default_rng(5)
        size = self.slope.shape[1]
        starts = np.vstack([np.zeros((1, size)), random.uniform(-1, 1, (2000, size))])
        sides, _ = self._solved(starts)
        self._check_count({side.tobytes() for side in sides})
        queue = [np.zeros_like(sides[0]), *sides]
        known: set[bytes] = set()
        while queue:
            side = queue.pop(0)
            if side.tobytes() in known:
                continue
            known.add(side.tobytes())
            region, beyond = self._region(side)
            if region is not None:
                self.found[side.tobytes()] = region
                queue += beyond
            self._check_count(self.found)
        return list(self.found.values())

    def _check_count(self, found: Collection[bytes]) -> None:
        if len(found) > MOST:
            raise DesignError(
                f"controller.solver = 'explicit' finds {len(found)} regions and more for {len(self.problem.low)} rows "
                f"and {len(self.middle)} parameters, at most {MOST} are put into a table; shorten the horizon, hold "
                'moves longer (blocks), limit fewer states, narrow the ranges in [signals], or use solver = "online"'
            )

    def _solved(self, points: Array) -> tuple[list[npt.NDArray[np.int64]], npt.NDArray[np.int64]]:
        """Return the active sets at points t, of those that have an optimum, and the status of each."""
        parameters = self.middle + self.half * np.clip(points[:, : len(self.middle)], -1.0, 1.0)
        solution = self.optimum(self.problem, parameters)
        return list(solution.side[solution.status == SOLVED]), solution.status

    def _region(self, side: npt.NDArray[np.int64]) -> tuple[Region | None, list[npt.NDArray[np.int64]]]:
        """Return the region of an active set, None where it has no inside, and the active sets around it."""
        held = self._constraints(side)
        if held is None:
            return None, []
        planes, law = held
        inside = _centre(planes)
        if inside is None:
            return None, []
        try:
            cut = scipy.spatial.HalfspaceIntersection(planes, inside)
        except scipy.spatial.QhullError:
            return None, []
        corners = cut.intersections[np.all(np.isfinite(cut.intersections), axis=1)]
        facets = np.unique(np.concatenate([np.ravel(facet) for facet in cut.dual_facets]))
        beyond, outer = self._beyond(planes[facets], corners)
        inner = facets < len(planes) - len(self.box)
        region = Region(planes[facets][inner], outer[inner], corners, law)
        return region, beyond

    def _constraints(self, side: npt.NDArray[np.int64]) -> tuple[Array, Array] | None:
        problem, active = self.problem, np.flatnonzero(side)
        limits = np.where(side > 0, problem.high, problem.low)[active]
        try:
            held = np.linalg.solve(
                problem.gram[np.ix_(active, active)],
                np.column_stack([self.slope[active], self.offset[active] - limits]),
            )
        except np.linalg.LinAlgError:
            return None
        rows = np.column_stack([self.slope, self.offset]) - problem.gram[:, active] @ held
        rows[active] = 0.0
        rows[active, -1] = limits
        free = side == 0
        above, below = free & np.isfinite(problem.high), free & np.isfinite(problem.low)
        last = np.eye(1, rows.shape[1], rows.shape[1] - 1)
        planes = np.vstack([
            rows[above] - problem.high[above][:, None] * last,
            problem.low[below][:, None] * last - rows[below],
            -side[active][:, None] * held,
        ])  # fmt: skip
        sizes = np.linalg.norm(planes[:, :-1], axis=1)
        if np.any((sizes <= FLAT) & (planes[:, -1] > FLAT)):
            return None
        planes = planes[sizes > FLAT] / sizes[sizes > FLAT][:, None]
        drives = len(problem.scale)
        return np.vstack([planes, self.box]), rows[:drives] * problem.scale[:, None]

    def _beyond(self, planes: Array, corners: Array) -> tuple[list[npt.NDArray[np.int64]], npt.NDArray[np.bool_]]:
        """Return the active sets a little outside of each plane, and which planes have none there."""
        outer, points = np.zeros(len(planes), dtype=bool), []
        for k, plane in enumerate(planes):
            on = corners[np.abs(corners @ plane[:-1] + plane[-1]) < THIN / 10]
            if len(on) == 0:
                continue
            middle = on.mean(axis=0)
            tried = np.vstack([middle, 0.6 * middle + 0.4 * on[:CORNERS]]) + THIN * plane[:-1]
            if np.all(np.abs(tried[0]) <= 1.0):
                points.append(tried)
                outer[k] = self._solved(tried[:1])[1][0] == INFEASIBLE
        if not points:
            return [], outer
        return self._solved(np.vstack(points))[0], outer


def _centre(planes: Array) -> Array | None:
    """Return the middle of the largest ball within a t <= b; None where that is thin (a linear program)."""
    size = planes.shape[1] - 1
    found = scipy.optimize.linprog(
        np.append(np.zeros(size), -1.0),
        A_ub=np.column_stack([planes[:, :-1], np.linalg.norm(planes[:, :-1], axis=1)]),
        b_ub=-planes[:, -1],
        bounds=[(-1.0, 1.0)] * size + [(0.0, None)],
        method="highs",
    )
    if found.status != 0 or found.x[-1] < THIN:
        return None
    return np.asarray(found.x[:-1])
