"""Round a nonlinear program to a number format, as a Program's table, and read it back for its iterations."""

from __future__ import annotations

from typing import Any

import numpy as np

from firmloop.design.law import Horizon
from firmloop.quantize.program import Table
from firmloop.quantize.twins.rti_course import FAR, Raw, RtiCourse, course_of

TOLERANCE = {"float32": 2.0**-18, "float64": 2.0**-40}  # share of a span by which a row may be violated
TRUSTED = {"float32": 2.0**-10, "float64": 2.0**-20}  # share of the spans by which an answer may miss its optimum
LEAST = {"float32": 2.0**-16, "float64": 2.0**-36}  # of a pivot, of its first value


def table_of(problem: Horizon, arithmetic: str, name: str, parameters: int) -> Table:
    """Round a problem to "float32" or "float64"; its members are those of `fl_rti_t`, `parameters` what it is given."""
    kind = np.dtype(arithmetic)
    course = course_of(problem, kind, TOLERANCE[arithmetic], TRUSTED[arithmetic], LEAST[arithmetic])

    def listed(values: Raw) -> tuple[float, ...]:
        return tuple(float(x) for x in values.ravel())

    sizes = {
        "FL_RTI_STATES": len(course.q),
        "FL_RTI_INPUTS": len(course.r),
        "FL_RTI_LENGTH": course.length,
        "FL_RTI_LIMITED": len(course.limited),
        "FL_RTI_PARAMETERS": parameters,
        "FL_RTI_ITERATIONS": course.iterations,
        "FL_RTI_BUDGET": course.budget,
    }
    numbers: dict[str, tuple[float, ...] | float] = {
        **{key: listed(getattr(course, key)) for key in ("q", "r", "p", "change", "rest", "low", "high", "weight")},
        "limited": (*(float(k) for k in course.limited), -1.0),
        "tolerance": course.tolerance,
        "trusted": course.trusted,
        "least": course.least,
        "far": float(kind.type(FAR)),
    }
    says = f"a nonlinear program over {course.length} samples, {course.unknowns} moves and {course.rows} limits"
    return Table(name, says, "fl_rti_t", "fl_rti.h", tuple(sizes.items()), tuple(numbers.items()))


def course_from(table: Table, kind: np.dtype[Any]) -> RtiCourse:
    """Make a table ready for `improve`."""
    numbers = {key: np.array(values, dtype=kind) for key, values in table.numbers}
    sizes = dict(table.sizes)
    n, m = sizes["FL_RTI_STATES"], sizes["FL_RTI_INPUTS"]
    tolerance, trusted, least = (numbers[name].item() for name in ("tolerance", "trusted", "least"))
    return RtiCourse(
        numbers["q"].reshape(n, n), numbers["r"].reshape(m, m), numbers["p"].reshape(n, n), numbers["change"],
        numbers["rest"], numbers["low"], numbers["high"], numbers["weight"],
        tuple(int(k) for k in numbers["limited"][:-1]), sizes["FL_RTI_LENGTH"], sizes["FL_RTI_ITERATIONS"],
        sizes["FL_RTI_BUDGET"], tolerance, trusted, least,
    )  # fmt: skip
