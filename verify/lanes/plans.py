"""Give every result of a program that is solved a row: what takes them apart becomes copies and comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from firmloop.design.outcome import CAPPED, INFEASIBLE
from firmloop.quantize.twins.qp import Rows
from firmloop.quantize.twins.rti_course import RtiCourse
from firmloop.verify.lanes.compiled import RowStep
from firmloop.verify.lanes.programs import CompiledModel, Improving, Solving

Improved = tuple[RtiCourse, CompiledModel]
OUTCOMES = {"capped": CAPPED, "infeasible": INFEASIBLE}


def known_as(step: RowStep) -> str:
    """Return the operation of the compiled code that stands for a step."""
    return "eq" if step.function in OUTCOMES else "copy" if step.function == "move" else step.function


def with_plans(
    steps: Sequence[RowStep], constants: Mapping[int, Any], free: int, plans: Mapping[int, Rows | Improved]
) -> tuple[list[RowStep | Improving | Solving], dict[int, Any]]:
    """Return the steps and the constants; rows from `free` on are taken.

    `plans` are the programs by the row of their operation; that of an "improve" is its problem and its model.
    """
    if not plans:
        return list(steps), dict(constants)
    status = dict(zip(OUTCOMES, (free, free + 1), strict=True))
    constants = {**constants, **{status[name]: value for name, value in OUTCOMES.items()}}
    free += len(OUTCOMES)
    found: list[RowStep | Improving | Solving] = []
    first: dict[int, tuple[int, int]] = {}  # rows of the first result and of the status
    for step in steps:
        if step.target in plans:
            plan = plans[step.target]
            places = step.places
            one = Solving(plan, places, free) if isinstance(plan, Rows) else Improving(plan[0], places, free, plan[1])
            found.append(one)
            first[step.target] = free, one.end
            free = one.end + 1
        elif step.function == "move":
            found.append(RowStep("copy", step.target, (first[step.places[0]][0] + step.whole[0],)))
        elif step.function in OUTCOMES:
            found.append(RowStep("eq", step.target, (first[step.places[0]][1], status[step.function])))
        else:
            found.append(step)
    return found, constants
