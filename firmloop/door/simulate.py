"""Predict a recording's outputs from its input."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.door.given import check_noun, fmu_given, path_given
from firmloop.door.identify import Identified
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, write_recording
from firmloop.identify.units import unit_of
from firmloop.output import results_file
from firmloop.presentation.figures import CurvePair, comparison_figure
from firmloop.presentation.notebook import notebook
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.stages import prediction
from firmloop.stages.data import read_as_named
from firmloop.stages.prediction import Start, as_recorded, at_rest
from firmloop.stages.progress import Stage, quietly

__all__ = ["Simulated", "as_recorded", "at_rest", "simulate"]


@dataclass(frozen=True, slots=True)
class Simulated:
    """A recording beside what the plant makes of its input.

    Attributes
    ----------
    measured
        the recording, time in s, columns in the units of their names
    predicted
        the same rows and columns, every output of the plant replaced by its simulation
    outputs
        the plant's outputs
    """

    measured: Recording
    predicted: Recording
    outputs: tuple[str, ...]

    def save(self, file: str | Path) -> None:
        """Write the prediction as a CSV file, `.csv` or `.csv.gz`."""
        with results_file(path_given("file:", file, "predicted.csv")) as partial:
            write_recording(self.predicted, partial)

    def _repr_html_(self) -> str:
        time, seen, said = self.measured.time, self.measured.columns, self.predicted.columns
        return notebook(
            comparison_figure(CurvePair(name, name, unit_of(name), time, seen[name], said[name]))
            for name in self.outputs
            if name in seen and name in said
        )


def simulate(
    project: Project | Identified,
    recording: str | os.PathLike[str],
    *,
    start: Start = at_rest,
    fmu: str | Path | None = None,
    wires: Mapping[str, str] | None = None,
    stage: Stage = quietly,
) -> Simulated:
    """Predict every output of a recording from its input column alone.

    Parameters
    ----------
    project
        a project with `[plant]`, unless there is an FMU, or what `identify` made of it: then the fitted plant is taken;
        `[recordings]` says how columns are named, where it is there
    recording
        the file, as `[recordings]` takes it
    start
        `firmloop.at_rest`, at the first recorded position, or `firmloop.as_recorded`, which fits the initial state
    fmu, wires
        a co-simulation FMU in the place of the equations of `[plant]`, from its own start, or without one; and, by our
        column, what it calls those that it has under another name. A variable with a unit is converted. It is a
        program of whoever made it, and runs in this process

    Raises
    ------
    ProjectError
        when a part of the project is missing or wrong.
    IdentifyError
        when the recording or the FMU cannot be used.
    ToolError
        when the C compiler that the simulator needs, or FMPy, is not installed.
    """
    check_noun("simulate", project, Project, Identified)
    fitted: Plant | None = None
    if isinstance(project, Identified):
        fitted, project = project.plant, project.project
    if not callable(start):
        raise TypeError(f"start: {start!r} is no start; give firmloop.at_rest or firmloop.as_recorded")
    given = fmu_given(fmu, wires)
    if given is not None:
        if start is as_recorded:
            raise ProjectError(f"--fit-initial: {given.file.name} begins where its maker has it begin; leave it out")
        read = read_as_named(project, path_given("recording:", recording, "test.csv"))
        with stage("simulating"):
            return Simulated(read, *prediction.predicted_by(given, project, read))
    require(project, "plant")
    read = read_as_named(project, path_given("recording:", recording, "test.csv"))
    assert project.plant is not None, "require() has seen to it"
    with stage("simulating"):
        return Simulated(read, prediction.predicted(project, read, start, fitted), project.plant.outputs)
