"""State space: a discrete linear controller given by its four matrices.

    u = C x + D z,    x+ = A x + B z,    then each u within its u_min and u_max

z are the inputs in the order of [signals], u the outputs in the order of controller.outputs; x starts at 0. Keys: `A`,
`B`, `C`, `D` as rows (D left out: zero), `u_min` and `u_max` a number or a list, by default the outputs' ranges.
`x_min` and `x_max` (numbers or lists, infinite where a state has none) limit x+: only so may a law with a pole on or
outside the unit circle be held in fixed point, or at all.
"""

from __future__ import annotations

import math

import numpy as np

from firmloop.design.design import Design, Kind, Request
from firmloop.design.draft import Draft, Element
from firmloop.design.law import DesignError
from firmloop.design.linear.linear_law import designed, symbols, weighted_sum
from firmloop.design.table import check_keys, each, matrix
from firmloop.identify.signal import Signal

KEYS = ("A", "B", "C", "D", "u_min", "u_max", "x_min", "x_max")


def design(request: Request) -> Design:
    """Read the matrices and write the law."""
    return designed(request, draft(request))


def draft(request: Request) -> Draft:
    """Read the matrices and write the equations."""
    table = request.table
    check_keys(table, KEYS, "a state_space")
    if not request.inputs or not request.outputs:
        raise DesignError("controller.kind = 'state_space' needs at least one input and one output in [signals]")
    wires, drives = len(request.inputs), len(request.outputs)
    order = len(matrix(table, "A", None, None, ""))
    a = matrix(table, "A", order, order, "its own rows")
    b = matrix(table, "B", order, wires, f"A and the {wires} inputs of [signals]")
    c = matrix(table, "C", drives, order, f"A and the {drives} outputs")
    d = (
        matrix(table, "D", drives, wires, "the outputs and inputs of [signals]")
        if "D" in table
        else np.zeros((drives, wires))
    )
    least, most = each(table, "x_min", [-math.inf] * order), each(table, "x_max", [math.inf] * order)
    for k, (down, up) in enumerate(zip(least, most, strict=True)):
        if not down <= 0 <= up or math.isinf(down) != math.isinf(up) or down == up:
            raise DesignError(
                f"controller.x_min and x_max of state {k + 1} are {down:g} and {up:g}; x starts at 0, which must lie "
                "between them, and both or neither must be finite"
            )
    z = symbols([wire.name for wire in request.inputs])
    x = symbols([f"x_{k}" for k in range(1, order + 1)])
    state = tuple(
        Element(symbol.name(), "1", symbol, weighted_sum([*a[k], *b[k]], [*x, *z]), least[k], most[k])
        for k, symbol in enumerate(x)
    )
    outputs = tuple(weighted_sum([*c[k], *d[k]], [*x, *z]) for k in range(drives))
    ends = ["unlimited"] if drives == 1 else [f"{wire.name}_unlimited" for wire in request.outputs]
    named = {end: (wire.unit, value) for end, wire, value in zip(ends, request.outputs, outputs, strict=True)}
    says = f"state space: {order} state{'' if order == 1 else 's'}, {wires} in, {drives} out"
    figures = {"slowest_pole": float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))}
    return Draft(says, z, state, outputs, named, figures, remedy="x_min and x_max limit it")


KIND = Kind(
    name="state_space",
    says="a discrete linear controller given by its matrices",
    design=design,
    draft=draft,
    example=Request(
        name="two_axis",
        table={
            "A": [[0.9, 0.2, 0.0], [-0.2, 0.9, 0.1], [0.0, 0.0, 0.5]],
            "B": [[0.1, -0.1, 0.0], [0.0, 0.2, 0.3], [1.0, 0.0, -1.0]],
            "C": [[1.5, 0.0, 0.4], [0.0, -2.0, 0.0]],
            "D": [[0.5, -0.5, 0.0], [0.0, 0.0, 1.0]],
            "u_min": [-4.0, -2.5],
            "u_max": 3.0,
        },
        period=0.002,
        inputs=(
            Signal("reference", "m", -1.0, 2.0),
            Signal("measurement", "m", -1.0, 2.0),
            Signal("tilt", "rad", -0.5, 0.5),
        ),
        outputs=(Signal("left", "N", -5.0, 5.0), Signal("right", "N", -3.0, 3.0)),
        plant=None,
    ),
)
