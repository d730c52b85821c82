"""Say where simulation and recordings of a project differ, and why."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.diagnose.controller.replay import Cut
from firmloop.diagnose.finding import Finding
from firmloop.diagnose.run import Diagnosis
from firmloop.door.given import check_noun, folder_given
from firmloop.door.identify import Identified
from firmloop.identify.plants.plant import Plant
from firmloop.output import save
from firmloop.presentation.diagnosis_report import diagnosis_report, diagnosis_sections
from firmloop.presentation.notebook import notebook
from firmloop.project.project import Project, require
from firmloop.project.project_text import diagnosed_text
from firmloop.stages.data import Data, read_data
from firmloop.stages.diagnosing import both_halves
from firmloop.stages.plant import command_of
from firmloop.stages.progress import Stage, quietly


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """What is missing in a project's plant or wrong in its controller.

    Attributes
    ----------
    project
        where it comes from
    data
        its recordings
    diagnosis
        the finding, and the plant that explains the recordings
    replayed
        what the replay of the controller on its recorded inputs says; None where there was nothing to replay
    """

    project: Project
    data: Data
    diagnosis: Diagnosis
    replayed: Cut | None

    @property
    def finding(self) -> Finding:
        """The verdict, the effects with 95 % intervals and units, the alternatives, and sentences that say it."""
        return self.diagnosis.finding

    def files(self, folder: str | Path) -> Mapping[str, str]:
        """Return the text of diagnosis.json, of project.toml as it may stand in `folder`, and of report.html."""
        made, command = self.diagnosis, command_of("diagnose", self.project.path)
        return {
            "diagnosis.json": json.dumps(self.finding.as_dict(), indent=1, allow_nan=False) + "\n",
            "project.toml": diagnosed_text(self.project, made.plant, made.hold, folder_given(folder)),
            "report.html": diagnosis_report(self.project.name, command, self.data, made, self.replayed),
        }

    def save(self, folder: str | Path) -> None:
        """Write diagnosis.json, the improved project.toml and report.html into `folder`."""
        save(self.files(folder), folder_given(folder))

    def _repr_html_(self) -> str:
        return notebook(diagnosis_sections(self.diagnosis, self.replayed))


def diagnose(project: Project | Identified, *, stage: Stage = quietly) -> Diagnosed:
    """Say where simulation and recordings differ and why.

    Parameters
    ----------
    project
        a project with `[plant]` and `[recordings]`, or what `identify` made of it: then the fitted plant is diagnosed.
        A plant without values is identified first

    Raises
    ------
    ProjectError
        when a part of the project is missing or wrong.
    IdentifyError
        when a recording cannot be used, or says too little.
    ToolError
        when the C compiler that the simulator needs is not installed.
    """
    check_noun("diagnose", project, Project, Identified)
    fitted: Plant | None = None
    if isinstance(project, Identified):
        fitted, data, project = project.plant, project.data, project.project
    else:
        require(project, "plant", "recordings")
        data = read_data(project)
    with stage("diagnosing") as report:
        return Diagnosed(project, data, *both_halves(project, data, report, fitted))
