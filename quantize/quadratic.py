"""Round a quadratic program to a number format, as a Program's table, and read it back for the solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from design.active_set import COLUMN, FAR, Raw, Rows, tolerance_of
from design.law import Quadratic
from quantize.program import Table

TOLERANCE = {"float32": 2.0**-18, "float64": 2.0**-40}  # share of the limits by which a row may be violated
SHARE = {"float32": 2.0**-20, "float64": 2.0**-46}  # of the first violation: what roundings leave of it
TRUSTED = 2.0**-8  # share of the limits by which an active row may miss its own
LEAST = {"float32": 2.0**-16, "float64": 2.0**-36}  # of a pivot, whose first value is 1
STIFF = 0.25  # of that, where limits are soft: their pivots are small, but never 0


def table_of(problem: Quadratic, arithmetic: str, name: str, budget: int, checked: bool) -> Table:
    """Round a problem to "float32" or "float64"; its members are those of `fl_qp_t`."""
    kind = np.dtype(arithmetic).type
    count, parameters = problem.slope.shape
    width = -(-count // 4) * 4

    def rounded(values: Raw) -> tuple[float, ...]:
        return tuple(float(x) for x in np.clip(values, -FAR, FAR).astype(kind).ravel())

    sizes = {
        "FL_QP_ROWS": count,
        "FL_QP_WIDTH": width,
        "FL_QP_PARAMETERS": parameters,
        "FL_QP_MOVES": len(problem.scale),
        "FL_QP_ROOM": min(problem.freedom, count),
        "FL_QP_COLUMN": COLUMN,
        "FL_QP_BUDGET": budget,
        "FL_QP_CHECKED": int(checked),
    }
    numbers: dict[str, tuple[float, ...] | float] = {
        "slope": rounded(np.pad(problem.slope, ((0, width - count), (0, 0))).T),
        "low": rounded(problem.low),
        "high": rounded(problem.high),
        "gram": rounded(np.pad(problem.gram, ((0, 0), (0, width - count)))),
        "scale": rounded(problem.scale),
        "tolerance": float(kind(TOLERANCE[arithmetic] * tolerance_of(problem))),
        "share": float(kind(SHARE[arithmetic])),
        "trusted": float(kind(TRUSTED * tolerance_of(problem))),
        "least": float(kind(LEAST[arithmetic] * (STIFF if problem.freedom > problem.moves > 0 else 1.0))),
        "far": float(kind(FAR)),
    }
    says = f"a quadratic program in {count} rows, {problem.freedom} unknowns and {parameters} parameters"
    return Table(name, says, "fl_qp_t", "fl_qp.h", tuple(sizes.items()), tuple(numbers.items()))


def rows_of(table: Table, kind: np.dtype[Any]) -> Rows:
    """Make a table ready for `solve`."""
    numbers = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    sizes = dict(table.sizes)
    count = sizes["FL_QP_ROWS"]
    gram = numbers["gram"].reshape(count, -1)
    slope = numbers["slope"].reshape(-1, gram.shape[1])[:, :count].T
    single = ("tolerance", "share", "trusted", "least")
    tolerance, share, trusted, least = (numbers[name].item() for name in single)
    return Rows(
        slope, numbers["low"], numbers["high"], gram[:, :count], numbers["scale"], tolerance, share, trusted, least,
        sizes["FL_QP_ROOM"], sizes["FL_QP_BUDGET"], bool(sizes["FL_QP_CHECKED"]),
    )  # fmt: skip
