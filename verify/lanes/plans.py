"""Give every result of a nonlinear program a row of its own: what takes them apart becomes copies and comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from firmloop.quantize.twins.rti_course import CAPPED, INFEASIBLE, RtiCourse
from firmloop.verify.lanes.compiled import Compiled, Improving, RowStep

OUTCOMES = {"capped": CAPPED, "infeasible": INFEASIBLE}


def known_as(step: RowStep) -> str:
    """Return the operation of the compiled code that stands for a step."""
    return "eq" if step.function in OUTCOMES else "copy" if step.function == "move" else step.function


def with_plans(
    steps: Sequence[RowStep], constants: Mapping[int, Any], free: int, plans: Mapping[int, tuple[RtiCourse, Compiled]]
) -> tuple[list[RowStep | Improving], dict[int, Any]]:
    """Return the steps and the constants; rows from `free` on are taken, `plans` by the row of each "improve"."""
    if not plans:
        return list(steps), dict(constants)
    status = dict(zip(OUTCOMES, (free, free + 1), strict=True))
    constants = {**constants, **{status[name]: value for name, value in OUTCOMES.items()}}
    free += len(OUTCOMES)
    found: list[RowStep | Improving] = []
    first: dict[int, tuple[int, int]] = {}  # rows of the first result and of the status
    for step in steps:
        if step.function == "improve":
            course, model = plans[step.target]
            improving = Improving(course, step.places, free, model)
            found.append(improving)
            first[step.target] = free, improving.end
            free = improving.end + 1
        elif step.function == "move":
            found.append(RowStep("copy", step.target, (first[step.places[0]][0] + step.whole[0],)))
        elif step.function in OUTCOMES:
            found.append(RowStep("eq", step.target, (first[step.places[0]][1], status[step.function])))
        else:
            found.append(step)
    return found, constants
