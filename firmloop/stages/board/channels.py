"""What is watched of a controller: its names, units, ranges, and raw rows as physical columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.quantize.program import Program, Value
from firmloop.verify.links.live import STATUS, watchable
from firmloop.verify.scaling import to_physical


@dataclass(frozen=True, slots=True)
class Channel:
    """One watched member of a step; `value` says how its raw samples are read, None where they are status bits.

    `column` is its name in a recording: the plant's own where a wire of the controller is one of the plant's ends.
    """

    name: str
    column: str
    unit: str
    low: float  # of its range: the project's for an input, the proven one for an output or a parameter
    high: float
    value: Value | None

    def physical(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """Return its samples in its unit."""
        raw = rows[self.name]
        return to_physical(self.value, raw) if self.value is not None else raw.astype(np.float64)


def channels(project: Project, program: Program, asked: Sequence[str], tuned: Sequence[str]) -> tuple[Channel, ...]:
    """Return what is asked for, else every input and output, and what is tuned, in the order of the image's bits.

    Raises
    ------
    ProjectError
        when a name is unknown.
    """
    known = watchable(program)
    wires = [value.name for value in (*program.inputs, *program.outputs)]
    for name in asked:
        if name not in known:
            raise ProjectError(f"--signals {name}: is no signal of {program.name}; known: {', '.join(known)}")
    values = {value.name: value for value in (*program.inputs, *program.outputs, *program.parameters)}
    names = [name for name in known if name in (asked or wires) or name in tuned]
    return tuple(_channel(project, program, name, values.get(name)) for name in names)


def _channel(project: Project, program: Program, name: str, value: Value | None) -> Channel:
    if value is None:
        assert name == STATUS, "watchable() names nothing else"
        return Channel(name, "controller_status", "", 0.0, float(2 ** len(program.status) - 1), None)
    low, high = to_physical(value, np.array([value.low, value.high]))
    return Channel(name, _column(project, program, name, value.unit), value.unit, float(low), float(high), value)


def _column(project: Project, program: Program, name: str, unit: str) -> str:
    plant = project.plant
    if plant is not None and name == "measurement":
        return plant.outputs[0]
    if plant is not None and name == program.outputs[0].name and len(program.outputs) == 1:
        return plant.input
    if plant is not None and name == "reference":
        return f"reference_{plant.outputs[0].partition('_')[2]}"
    suffix = re.sub(r"[^A-Za-z0-9]+", "_", unit).strip("_")
    return f"{name}_{suffix}" if suffix else name
