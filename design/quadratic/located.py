"""Follow a tree of planes from parameters to the affine law of their moves.

It stands apart from what finds a tree: every law is evaluated, few have one to be found.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from firmloop.design.law import Tree
from firmloop.design.optimum import Solution
from firmloop.design.outcome import INFEASIBLE, SOLVED

Array = npt.NDArray[np.float64]


def located(tree: Tree, parameters: Array) -> Solution:
    """Follow the tree for every row of `parameters` (lanes, p)."""
    lanes = np.arange(len(parameters))
    node, depth = np.zeros(len(lanes), np.int64), np.zeros(len(lanes), np.int64)
    known = np.column_stack([parameters, np.ones(len(lanes))])
    below, above = np.array(tree.below, np.int64), np.array(tree.above, np.int64)
    while np.any(node >= 0):
        here = np.flatnonzero(node >= 0)
        side = np.einsum("ij,ij->i", tree.planes[node[here]], known[here]) > 0
        node[here] = np.where(side, above[node[here]], below[node[here]])
        depth[here] += 1
    law = -1 - node
    moves = np.einsum("lkj,lj->lk", tree.laws[law], known)
    status = np.where(law == len(tree.laws) - 1, INFEASIBLE, SOLVED)
    return Solution(moves, status.astype(np.int64), depth, np.zeros((len(lanes), 0), np.int64))
