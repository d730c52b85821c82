"""The project's controller, to be played again on what a recording says it was given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from firmloop.design.design import Design
from firmloop.design.kinds import design as design_law
from firmloop.design.law import DesignError, Law, Scalar
from firmloop.design.roles import reference_and_measurement
from firmloop.project.project import Project
from firmloop.project.project_text import settled
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.twins.qp import optimum
from firmloop.quantize.word_length import lower_within
from firmloop.stages.plant import plant_of
from firmloop.verify.replay import Controller


def controller_of(project: Project) -> Controller | None:
    """Return the project's controller, to be played again on what a recording says it was given; None without one.

    A controller that cannot be designed is none: to diagnose a plant needs no controller.
    """
    part = project.controller
    if part is None or not project.signals or len(project.controller_outputs) == 0:
        return None
    plant = plant_of(project) if project.plant else None

    def made(table: Mapping[str, object], period: float, limits: tuple[float, float] | None) -> Design | None:
        outputs = project.controller_outputs
        if limits is not None:
            outputs = (replace(outputs[0], low=limits[0], high=limits[1]), *outputs[1:])
        try:
            return design_law(
                part.kind, project.name, table, period, project.controller_inputs, outputs, plant, optimum
            )
        except DesignError:
            return None

    designed = made(part.settings, part.period, None)
    if designed is None or not _plain(designed.law):
        return None
    try:
        program = lower_within(designed.law, project.formats, project.allowed, project.rounds)
        wires = reference_and_measurement(designed.law.inputs)
    except (QuantizeError, DesignError):
        return None
    told = settled(part.settings, designed)
    found = [key for key in told if key not in part.settings]
    defaults = []
    for key in found:
        other = made({name: value for name, value in told.items() if name != key}, part.period, None)
        if other is not None and other.gains.get(key) == designed.gains.get(key):
            defaults.append(key)
    tuned = tuple(key for key in found if key not in defaults)

    def rebuild(table: Mapping[str, object], period: float, limits: tuple[float, float] | None) -> Law | None:
        changed = made(table, period, limits)
        return changed.law if changed is not None and _plain(changed.law) else None

    return Controller(designed.law, program, told, tuple(defaults), tuned, wires, rebuild)


def _plain(law: Law) -> bool:
    """Whether a law is one stage of straight arithmetic, which can be played fast."""
    return len(law.stages) == 1 and isinstance(law.stages[0], Scalar)
