"""Round a quadratic program to a number format, as a Program's table, and read it back for the solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from firmloop.design.law import Quadratic
from firmloop.design.outcome import COLUMN
from firmloop.quantize.program import Table
from firmloop.quantize.twins.qp import FAR, Raw, Rows, tolerance_of

TOLERANCE = {"float32": 2.0**-18, "float64": 2.0**-40}  # share of the limits by which a row may be violated
SHARE = {"float32": 2.0**-20, "float64": 2.0**-46}  # of the first violation: what roundings leave of it
TRUSTED = 2.0**-8  # share of the limits below which a correction of a move is the last
KEPT = 2.0**-10  # share of the limits by which moves may miss a row that is taken to be at its limit
NOISE = {"float32": 2.0**-17, "float64": 2.0**-44}  # of a multiplier: what its roundings may do to a row
LAST_PLACE = {"float32": 2.0**-24, "float64": 2.0**-53}  # of it, where answers are not checked: its own rounding
SOFT = 2.0**-20  # of a row, at least, that is its softness; less is rounding
LEAST = {"float32": 2.0**-16, "float64": 2.0**-36}  # of a pivot, whose first value is 1
STIFF = 0.25  # of that, where limits are soft: their pivots are small, but never 0
MANY, MANY_ROWS = "fl_qp_many.h", 2  # times the rows that can be active, above which a search keeps a factor of these
FINE = 0.0625  # of that, where answers are checked: rows that depend on each other are told by their number too


def table_of(problem: Quadratic, arithmetic: str, name: str, budget: int, checked: bool) -> Table:
    """Round a problem to "float32" or "float64"; its members are those of `fl_qp_t`."""
    kind = np.dtype(arithmetic).type
    count, parameters = problem.slope.shape
    width = -(-count // 4) * 4

    def rounded(values: Raw) -> tuple[float, ...]:
        return tuple(float(x) for x in np.clip(values, -FAR, FAR).astype(kind).ravel())

    beyond, softness = _beyond(problem) if checked else (np.zeros((1, parameters + 1)), np.zeros(1))
    sizes = {
        "FL_QP_ROWS": count,
        "FL_QP_WIDTH": width,
        "FL_QP_PARAMETERS": parameters,
        "FL_QP_MOVES": len(problem.scale),
        "FL_QP_ROOM": min(problem.freedom, count),
        "FL_QP_COLUMN": COLUMN,
        "FL_QP_BUDGET": budget,
        "FL_QP_CHECKED": problem.moves if checked else 0,
        "FL_QP_BEYOND": len(softness),
        "FL_QP_ONWARD": beyond.shape[1] - parameters,
    }
    numbers: dict[str, tuple[float, ...] | float] = {
        "slope": rounded(np.pad(problem.slope, ((0, width - count), (0, 0))).T),
        "low": rounded(np.pad(problem.low, (0, width - count), constant_values=-FAR)),
        "high": rounded(np.pad(problem.high, (0, width - count), constant_values=FAR)),
        "gram": rounded(np.pad(problem.gram, ((0, 0), (0, width - count)))),
        "scale": rounded(problem.scale),
        "tolerance": float(kind(TOLERANCE[arithmetic] * tolerance_of(problem))),
        "share": float(kind(SHARE[arithmetic])),
        "trusted": float(kind(TRUSTED * tolerance_of(problem))),
        "kept": float(kind(FAR if problem.feasible else KEPT * tolerance_of(problem))),
        "noise": float(kind((NOISE if checked else LAST_PLACE)[arithmetic])),
        "least": float(kind(_least(problem, arithmetic, checked))),
        "far": float(kind(FAR)),
        "beyond": rounded(beyond),
        "softness": rounded(softness),
    }
    says = f"a quadratic program in {count} rows, {problem.freedom} unknowns and {parameters} parameters"
    return Table(
        name,
        says,
        "fl_qp_t",
        MANY if not checked and count > MANY_ROWS * sizes["FL_QP_ROOM"] else "fl_qp.h",
        tuple(sizes.items()),
        tuple(numbers.items()),
    )


def _least(problem: Quadratic, arithmetic: str, checked: bool) -> float:
    """Return the smallest pivot of a row that does not depend on the active ones."""
    if checked:
        return LEAST[arithmetic] * FINE
    return LEAST[arithmetic] * (STIFF if problem.freedom > problem.moves > 0 else 1.0)


def _beyond(problem: Quadratic) -> tuple[Raw, Raw]:
    """Return the rows behind those of the moves, of parameters and moves (rows, p + moves), and their softness.

    Moves and multipliers follow each other by the gram of the moves' rows, whose columns are the rows times H^-1. Where
    there are no such rows, one of zeros.
    """
    moves = problem.moves
    if len(problem.low) == moves:
        return np.zeros((1, problem.slope.shape[1] + moves)), np.zeros(1)
    onward = np.linalg.solve(problem.gram[:moves, :moves], problem.gram[:moves, moves:]).T
    shift = problem.slope[moves:] - onward @ problem.slope[:moves]
    softness = 1.0 - np.einsum("ij,ji->i", onward, problem.gram[:moves, moves:])
    return np.hstack([shift, onward]), np.where(softness > SOFT, softness, 0.0)


def rows_of(table: Table, kind: np.dtype[Any]) -> Rows:
    """Make a table ready for `solve`."""
    numbers = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    sizes = dict(table.sizes)
    count = sizes["FL_QP_ROWS"]
    gram = numbers["gram"].reshape(count, -1)
    slope = numbers["slope"].reshape(-1, gram.shape[1])[:, :count].T
    single = ("tolerance", "share", "trusted", "kept", "noise", "least")
    tolerance, share, trusted, kept, noise, least = (numbers[name].item() for name in single)
    moves = sizes["FL_QP_CHECKED"]
    behind = count - moves if moves else 0
    beyond = numbers["beyond"].reshape(sizes["FL_QP_BEYOND"], -1)[:behind]
    shift, onward = np.split(beyond, [sizes["FL_QP_PARAMETERS"]], axis=1)
    return Rows(
        slope, numbers["low"][:count], numbers["high"][:count], gram[:, :count], numbers["scale"], tolerance, share,
        trusted, kept, noise, least, sizes["FL_QP_ROOM"], sizes["FL_QP_BUDGET"], moves, shift, onward,
        numbers["softness"][:behind], table.support == MANY,
    )  # fmt: skip
