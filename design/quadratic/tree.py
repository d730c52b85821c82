"""Write the regions of a quadratic program as a binary tree of planes: which side of each, then one affine law.

Each node asks for the side of the plane that leaves fewest regions on the fuller side; a region that a plane cuts goes
both ways (Tondel, Johansen and Bemporad, Automatica 39, 2003). Regions with the same law of the first move need not be
told apart, and the same set of regions is asked the same questions wherever it is met, once in the table. Before a law
is taken, the planes on the outer border of its regions are asked: beyond one of them there is no optimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from firmloop.design.law import DesignError, Law, Quadratic, Tree
from firmloop.design.optimum import QuadraticSolver
from firmloop.design.outcome import SOLVED
from firmloop.design.quadratic.located import located
from firmloop.design.quadratic.partition import SAME, THIN, Region, partition
from firmloop.design.quadratic.region import box_of, drawn_parameters

Array = npt.NDArray[np.float64]

JUDGED = 2000  # parameters drawn evenly, and as many toward the middle
ALLOWED = 1e-5  # share of a move's range
MOST_NODES = 4000


@dataclass(frozen=True, slots=True)
class JudgedTree:
    """How a tree was found and judged."""

    regions: int
    worst: float  # error of a move over its range, from `count` drawn parameters that have an optimum
    count: int


def choose_tree(law: Law, optimum: QuadraticSolver) -> tuple[Tree, JudgedTree]:
    """Return the tree of a law's quadratic program, judged by its optimum.

    Raises
    ------
    DesignError
        when there are too many regions or parameters, or the tree is not the optimum where it is tried.
    """
    assert law.solve is not None
    problem = law.solve.quadratic
    low, high = box_of(law)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-12)
    regions = partition(problem, middle, half, optimum)
    tree = _Builder(problem, regions, middle, half).tree()
    parameters = drawn_parameters(law, JUDGED, 3)
    best, found = optimum(problem, parameters), located(tree, parameters)
    good = best.status == SOLVED
    ends = [limit[: len(problem.scale)] * problem.scale for limit in (problem.low, problem.high)]
    away = np.abs(np.clip(found.moves, *ends) - np.clip(best.moves, *ends))[good] / (ends[1] - ends[0])
    worst = float(np.max(away, initial=0.0))
    if worst > ALLOWED:
        raise DesignError(
            f"controller.solver = 'explicit' finds {len(regions)} regions, which miss the optimum by {worst:.3g} of "
            "the output's range: some are too thin to be found; narrow the ranges in [signals], or use "
            'solver = "online"'
        )
    return tree, JudgedTree(len(regions), worst, int(np.count_nonzero(good)))


@dataclass(frozen=True, slots=True)
class _Node:
    plane: Array
    children: tuple[int, int]  # below, above; -1 - law


class _Builder:
    """The nodes so far; a set of regions has the same subtree wherever it is met."""

    def __init__(self, problem: Quadratic, regions: list[Region], middle: Array, half: Array) -> None:
        self.regions, self.middle, self.half = regions, middle, half
        self.planes = _distinct([plane for r in regions for plane in r.planes[~r.outer]])
        self.outer = [_distinct(list(region.planes[region.outer])) for region in regions]
        sides = [region.corners @ self.planes[:, :-1].T + self.planes[:, -1] for region in regions]
        self.below = np.array([side.min(axis=0) < -THIN / 2 for side in sides]).T  # (planes, regions)
        self.above = np.array([side.max(axis=0) > THIN / 2 for side in sides]).T
        self.range = (problem.high - problem.low)[: len(problem.scale)] * problem.scale
        self.laws: list[Array] = []
        self.law = np.array([self._law(region.law) for region in regions])
        self.nodes: list[_Node] = []
        self.known: dict[bytes, int] = {}

    def tree(self) -> Tree:
        """Return the tree, in the parameters themselves; the last law is the first one again, for outside."""
        root = self._grown(np.ones(len(self.regions), dtype=bool))
        if root < 0:  # one law everywhere: ask once for nothing
            self.nodes.append(_Node(np.zeros(self.regions[0].corners.shape[1] + 1), (root, root)))
            root = 0
        order = self._order(root)
        place = {node: k for k, node in enumerate(order)}
        size = len(self.middle)

        def child(node: int) -> int:
            return place[node] if node >= 0 else node

        planes = np.array([self.nodes[k].plane for k in order])
        laws = np.array([*self.laws, self._free()])
        return Tree(
            self._back(planes, size),
            tuple(child(self.nodes[k].children[0]) for k in order),
            tuple(child(self.nodes[k].children[1]) for k in order),
            self._back(laws, size),
        )

    def _free(self) -> Array:
        """Return the law where no limit acts."""
        return self.regions[0].law

    def _law(self, law: Array) -> int:
        for k, known in enumerate(self.laws):
            if np.max(np.abs(law - known) / self.range[:, None]) < SAME:
                return k
        self.laws.append(law)
        return len(self.laws) - 1

    def _back(self, values: Array, size: int) -> Array:
        """Turn functions of (t, 1) into functions of (parameters, 1)."""
        factors = values[..., :size] / self.half
        return np.concatenate([factors, values[..., -1:] - (factors @ self.middle)[..., None]], axis=-1)

    def _order(self, root: int) -> list[int]:
        """Return the nodes that are reached, each before those that follow: these were made before it."""
        found: set[int] = set()
        pending = [root]
        while pending:
            node = pending.pop()
            if node >= 0 and node not in found:
                found.add(node)
                pending += self.nodes[node].children
        return sorted(found, reverse=True)

    def _grown(self, members: npt.NDArray[np.bool_]) -> int:
        """Return the node, or -1 - law, that tells these regions apart."""
        key = members.tobytes()
        if key not in self.known:
            laws = np.unique(self.law[members])
            best = self._best(members) if len(laws) > 1 else None
            if best is None:
                self.known[key] = self._bordered(members, int(laws[0]))
            else:
                below, above = (self._grown(members & side[best]) for side in (self.below, self.above))
                self.known[key] = self._node(self.planes[best], below, above)
        return self.known[key]

    def _best(self, members: npt.NDArray[np.bool_]) -> int | None:
        """Return the plane that leaves fewest on its fuller side; None where none leaves fewer."""
        counts = np.stack([(side & members).sum(axis=1) for side in (self.below, self.above)])
        fuller, total = counts.max(axis=0), counts.sum(axis=0)
        best = int(np.lexsort((total, fuller))[0])
        return best if fuller[best] < members.sum() else None

    def _bordered(self, members: npt.NDArray[np.bool_], law: int) -> int:
        node = -1 - law
        for plane in _distinct([p for k in np.flatnonzero(members) for p in self.outer[k]]):
            node = self._node(plane, node, -1 - len(self.laws))
        return node

    def _node(self, plane: Array, below: int, above: int) -> int:
        if below == above:
            return below
        if len(self.nodes) >= MOST_NODES:
            raise DesignError(
                f"controller.solver = 'explicit' finds {len(self.regions)} regions, whose search tree has more than "
                f'{MOST_NODES} nodes; shorten the horizon, hold moves longer (blocks), or use solver = "online"'
            )
        self.nodes.append(_Node(plane, (below, above)))
        return len(self.nodes) - 1


def _distinct(planes: list[Array]) -> Array:
    """Return the planes without repetition, whichever side is asked for."""
    width = len(planes[0]) if planes else 0
    found: list[Array] = []
    seen: set[tuple[int, ...]] = set()
    for plane in planes:
        first = plane[np.argmax(np.abs(plane[:-1]) > 1e-6)]
        key = tuple(int(x) for x in np.round(plane * np.sign(first) / (100 * SAME)))
        if key not in seen:
            seen.add(key)
            found.append(plane)
    return np.array(found).reshape(len(found), width)
