"""Round the tree of a quadratic program to a number format.

In fixed point only the sign of a plane's sum matters, so each plane has a format of its own; all laws share one. The
sums have 64 bits, and every weight is as fine as 32 bits and the ranges of the parameters allow. How far the law of
another region is from that of the right one, where a rounding takes the wrong side of a plane, is not followed: the
moves are the same on the plane itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from firmloop.design.law import Quadratic, Tree
from firmloop.quantize.lower.builder import Term
from firmloop.quantize.lower.sweep_formats import LONG, MOST_SHIFT, WORD, Planned
from firmloop.quantize.program import QuantizeError, Table
from firmloop.quantize.twins.trees import ONE

Array = npt.NDArray[np.float64]


def float_tree(tree: Tree, arithmetic: str, name: str) -> Planned:
    """Round to "float32" or "float64"; the members are those of `fl_tree_t` in fl_tree.h."""
    kind = np.dtype(arithmetic).type
    laws = tree.laws.astype(kind).ravel()
    if not np.all(np.isfinite(laws)):
        raise QuantizeError("a law of the explicit controller is beyond every value in float32; use float64")
    planes = (float(x) for x in tree.planes.astype(kind).ravel())
    numbers = {"plane": tuple(planes), "law": tuple(float(x) for x in laws)}
    return Planned("tree", _table(tree, name, "fl_tree.h", {}, numbers), -math.inf, math.inf, math.inf)


def fixed_tree(tree: Tree, problem: Quadratic, parameters: Sequence[Term], q: int, name: str) -> Planned:
    """Round to fixed point, the moves at fraction `q`; the members are those of `fl_tree_t` in fl_tree_i32.h.

    Raises
    ------
    QuantizeError
        when the weights of a law are too far apart from its parameters' ranges.
    """
    largest = np.array([*(max(-p.low, p.high) for p in parameters), ONE], dtype=np.float64)
    grids = np.array([*(2.0**-p.number.fraction for p in parameters), 1.0 / ONE])
    planes: list[int] = []
    for plane in tree.planes * grids:
        planes += _rounded(plane, _shift(plane[None], largest))
    laws = (tree.laws * 2.0**q * grids).reshape(-1, len(largest))
    shift = _shift(laws, largest)
    if shift < 1:
        reached = float(np.max(np.abs(laws) @ largest)) * 2.0**-q
        raise QuantizeError(
            f"the laws of the explicit controller are too steep for fixed point: the terms of one reach {reached:.4g} "
            f"over the ranges in [signals], beside a resolution of 2^-{q}; narrow the ranges, rescale them, or use "
            'solver = "fixed_iterations"'
        )
    first = len(problem.scale)
    least = [math.ceil(x * 2.0**q) for x in problem.low[:first] * problem.scale]
    most = [math.floor(x * 2.0**q) for x in problem.high[:first] * problem.scale]
    numbers = {
        "plane": tuple(planes),
        "law": tuple(x for law in laws for x in _rounded(law, shift)),
        "least": tuple(least),
        "most": tuple(most),
    }
    table = _table(tree, name, "fl_tree_i32.h", {"FL_SHIFT_LAW": shift}, numbers)
    top = max(-min(least), max(most))
    return Planned("tree", table, -top, top, math.inf)


def _table(tree: Tree, name: str, support: str, more: dict[str, int], numbers: dict[str, tuple[float, ...]]) -> Table:
    laws, drives, width = tree.laws.shape
    sizes = {
        "FL_QP_PARAMETERS": width - 1, "FL_QP_MOVES": drives, "FL_TREE_NODES": len(tree.planes),
        "FL_TREE_DEPTH": tree.depth, "FL_TREE_LAWS": laws,
    }  # fmt: skip
    says = f"a quadratic program in {width - 1} parameters as {len(tree.planes)} planes and {laws - 1} laws"
    members: dict[str, tuple[float, ...] | float] = {**numbers, "below": tree.below, "above": tree.above}
    return Table(name, says, "fl_tree_t", support, tuple((sizes | more).items()), tuple(members.items()))


def _shift(rows: Array, largest: Array) -> int:
    """Return the most places behind the point for these weights such that weights and sums fit."""
    weight, total = float(np.max(np.abs(rows))), float(np.max(np.abs(rows) @ largest))
    room = min(WORD / weight if weight else math.inf, LONG / 4 / total if total else math.inf)
    return min(MOST_SHIFT, math.floor(math.log2(room))) if math.isfinite(room) else 1


def _rounded(row: Array, shift: int) -> list[int]:
    return [math.floor(float(x) * 2.0**shift + 0.5) for x in row]
