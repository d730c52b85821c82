"""What may be set on a running controller: a tunable parameter, within its proven range."""

from __future__ import annotations

import numpy as np

from firmloop.project.table import ProjectError
from firmloop.quantize.program import Program
from firmloop.stages.board.tape import Setting
from firmloop.verify.scaling import to_physical, to_raw


def setting_of(program: Program, name: str, value: float, after: int) -> Setting:
    """Return a setting as the controller holds it.

    Raises
    ------
    ProjectError
        when `name` is no tunable parameter, or `value` is beyond its proven range.
    """
    parameters = {parameter.name: parameter for parameter in program.parameters}
    if name not in parameters:
        raise ProjectError(
            f"{name}: is no tunable parameter of {program.name}; "
            f"tunable: {', '.join(parameters) or 'none, see [controller] tunable'}"
        )
    parameter = parameters[name]
    raw = to_raw(parameter, np.array([value]))
    if not parameter.low <= raw[0] <= parameter.high:
        low, high = to_physical(parameter, np.array([parameter.low, parameter.high]))
        raise ProjectError(
            f"{name}={value:g}: is beyond its proven range, {low:.6g} to {high:.6g} "
            f"{parameter.unit or '1'}; to go there, widen controller.ranges.{name} and flash the program anew"
        )
    return Setting(name, raw, after)
