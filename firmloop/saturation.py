"""Refuse an input that goes beyond what the project's actuator can give: there it is not what the plant has seen."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.project import Project, same_unit
from firmloop.table import ProjectError
from identify.recording import Recording
from identify.units import unit_of

ROUNDING = 1e-3  # share of the range that a recording may stand beyond its end


def refuse_saturated(project: Project, recordings: Sequence[Recording], name: str = "") -> None:
    """Refuse what `saturated` finds.

    Raises
    ------
    ProjectError
        naming the recording, how far it goes and how far the actuator goes.
    """
    found = saturated(project, recordings, name)
    if found:
        raise ProjectError(f"{project.path}: {found}")


def saturated(project: Project, recordings: Sequence[Recording], name: str = "") -> str:
    """Compare the plant's input with the range of the controller's first output, where the units are the same.

    Return a sentence about the first recording that goes beyond it, nothing where none does.
    """
    drive = name or (project.plant.input if project.plant else "")
    outputs = project.controller_outputs if project.controller else ()
    wires = [signal for signal in (outputs or project.signals) if signal.name in ("output", *[o.name for o in outputs])]
    if not wires or not unit_of(drive) or not same_unit(wires[0].unit, unit_of(drive)):
        return ""
    wire = wires[0]
    slack = ROUNDING * (wire.high - wire.low)
    for recording in recordings:
        if drive not in recording.columns:
            continue
        values = recording.columns[drive]
        beyond = (values > wire.high + slack) | (values < wire.low - slack)
        if beyond.any():
            worst = values.max() if values.max() - wire.high > wire.low - values.min() else values.min()
            return (
                f"{drive} of {recording.source} goes to {worst:g} {wire.unit}, but signals.{wire.name} "
                f"ends at {wire.low:g} and {wire.high:g}: the actuator saturates in {beyond.mean():.0%} of the rows; "
                "make the signal smaller, or correct the range"
            )
    return ""
