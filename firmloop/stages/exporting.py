"""Make the FMU of a project's plant, with all its effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from firmloop.codegen.plant_fmu import plant_fmu_files
from firmloop.identify.simulation.portable import portable
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.stages.plant import command_of, located, plant_of


@dataclass(frozen=True, slots=True)
class PlantExport:
    """The files of an FMU by their place in it, and how often it takes its inputs, s."""

    files: Mapping[str, str]
    period: float


def export_plant(project: Project, step: float | None) -> PlantExport:
    """Return the FMU of the plant; without a `step`, s, it takes its inputs as often as the controller steps.

    Raises
    ------
    ProjectError
        when there is no plant, a parameter without a value, or no step.
    """
    require(project, "plant")
    period = step or (project.controller.period if project.controller else None)
    if period is None:
        raise ProjectError(
            f"{project.path}: it has no controller that says how often the plant takes its inputs; give --step SECONDS"
        )
    plant = plant_of(project)
    with located(project):
        made = portable(plant, period)
        command = command_of("export", project.path)
        files = plant_fmu_files(f"{project.name}_plant", made, (plant.inputs, plant.outputs), period, command)
    return PlantExport(files, period)
