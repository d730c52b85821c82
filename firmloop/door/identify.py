"""Fit a project's plant to its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.door.given import check_noun, folder_given
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.plants.plant import Plant
from firmloop.output import save
from firmloop.presentation.notebook import notebook
from firmloop.presentation.sections import plant_section
from firmloop.project.project import Project, require
from firmloop.project.project_text import fitted_text
from firmloop.stages import fitting
from firmloop.stages.data import Data, read_data
from firmloop.stages.progress import Stage, quietly


@dataclass(frozen=True, slots=True)
class Identified:
    """A plant with fitted parameters.

    Attributes
    ----------
    project
        where it comes from
    data
        the recordings, time in s, columns in the units of their names
    fit
        parameters (SI units) with standard deviations, scores of each recording, noise of each output
    """

    project: Project
    data: Data
    fit: Fit

    @property
    def plant(self) -> Plant:
        """The plant with the fitted parameters."""
        return self.fit.plant

    def files(self, folder: str | Path) -> Mapping[str, str]:
        """Return the text of project.toml as it may stand in `folder`."""
        return {"project.toml": fitted_text(self.project, self.plant, folder_given(folder))}

    def save(self, folder: str | Path) -> None:
        """Write project.toml with the fitted parameters and their 95 % intervals into `folder`."""
        save(self.files(folder), folder_given(folder))

    def _repr_html_(self) -> str:
        return notebook(plant_section(self.fit, self.data))


def identify(project: Project, *, stage: Stage = quietly) -> Identified:
    """Fit the plant to the train recordings; score it on train and test.

    Parameters
    ----------
    project
        with `[plant]` and `[recordings]`
    stage
        called with the name of what is being done; gives a context whose value is called with the share done, 0 to 1,
        and words

    Raises
    ------
    ProjectError
        when a part of the project is missing or wrong.
    IdentifyError
        when a recording cannot be used, or says too little.
    ToolError
        when the C compiler that the simulator needs is not installed.
    """
    check_noun("identify", project, Project)
    require(project, "plant", "recordings")
    data = read_data(project)
    with stage("fitting the plant") as report:
        return Identified(project, data, fitting.identify(project, data, report))
