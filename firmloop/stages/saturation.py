"""Refuse what is cut off: an input beyond what the actuator can give, an output that rests at the end of its range."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.plants.effects import effects
from firmloop.identify.recordings.clipping import cut_off, holds_elsewhere, in_steps
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.units import unit_of
from firmloop.project.project import Project, same_unit
from firmloop.project.table import ProjectError

ROUNDING = 1e-3  # share of the range that a recording may stand beyond its end


def refuse_saturated(project: Project, recordings: Sequence[Recording], name: str = "") -> None:
    """Refuse what `saturated` or `cut_output` finds.

    Raises
    ------
    ProjectError
        naming the recording, the signal, and where it ends.
    """
    found = saturated(project, recordings, name) or cut_output(project, recordings)
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
                f"ends at {wire.low:g} and {wire.high:g}: the actuator saturates in {100.0 * beyond.mean():.2g} % "
                "of the rows; make the signal smaller, or correct the range"
            )
    return ""


def cut_output(project: Project, recordings: Sequence[Recording]) -> str:
    """Return a sentence about the first output that is cut off though no effect of the plant does that."""
    part = project.plant
    asked = part.table.values.get("effects") if part else None
    listed = asked if isinstance(asked, list) else []
    limiting = [effect.name for effect in effects().values() if effect.limits]
    if part is None or any(isinstance(each, dict) and each.get("name") in limiting for each in listed):
        return ""
    for recording in recordings:
        for name in part.outputs:
            found = cut_off(recording.columns[name]) if name in recording.columns else None
            if found and not holds_elsewhere(recording.columns[name], found.value):
                return (
                    f"{name} of {recording.source} is cut off at {found.value:g} {unit_of(name)} in "
                    f"{100.0 * found.share:.2g} % of the rows, as by a sensor or actuator at its limit or by an end "
                    f"stop, and {part.kind} has none; record a smaller motion, or let diagnose find out what it is"
                )
    return ""


def cut_input(project: Project, recordings: Sequence[Recording]) -> str:
    """Return a sentence about the first recording whose input runs into a limit."""
    drive = project.plant.input if project.plant else ""
    for recording in recordings:
        found = cut_off(recording.columns[drive]) if drive in recording.columns else None
        if found and not in_steps(recording.columns[drive], found.value):
            return (
                f"{drive} of {recording.source} runs into {found.value:g} {unit_of(drive)} and rests there in "
                f"{100.0 * found.share:.2g} % of the rows: it must be what the actuator gave, not what it was asked for"
            )
    return ""
