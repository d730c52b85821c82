"""Design a project's controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.design.analysis.contest import Entry
from firmloop.design.design import Design
from firmloop.design.law import Law
from firmloop.door.given import check_noun, folder_given
from firmloop.door.identify import Identified
from firmloop.identify.plants.plant import Plant
from firmloop.output import save
from firmloop.presentation.documents import design_document, result_json
from firmloop.presentation.notebook import notebook
from firmloop.presentation.sections import controller_section, tuning_section
from firmloop.presentation.tuning_table import contest_document
from firmloop.project.project import Project, require
from firmloop.project.project_text import designed_text
from firmloop.stages import making
from firmloop.stages.analysis import Loop, analyze
from firmloop.stages.plant import plant_of
from firmloop.stages.progress import Stage, quietly
from firmloop.stages.tuning import beside


@dataclass(frozen=True, slots=True)
class Designed:
    """A controller as real-valued arithmetic, and how it gets on with the plant.

    Attributes
    ----------
    project
        where it comes from
    plant
        what it is designed for; None where the project has none
    design
        law and gains
    loop
        margins (dB, deg, s, rad/s), a step of the reference, and its figures; None where there is no plant or no
        reference
    tuned
        what other tuning rules make of the plant, where `[tuning]` or a rule is asked for
    """

    project: Project
    plant: Plant | None
    design: Design
    loop: Loop | None
    tuned: tuple[Entry, ...]

    @property
    def law(self) -> Law:
        """The controller: inputs, outputs and state with their units and ranges, and the equations."""
        return self.design.law

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains by name, as the project file takes them."""
        return self.design.gains

    def files(self, folder: str | Path) -> Mapping[str, str]:
        """Return the text of design.json and of project.toml as it may stand in `folder`."""
        tuning = {"tuning": contest_document(self.tuned)} if self.tuned else {}
        return {
            "design.json": result_json({**design_document(self.design, self.loop), **tuning}),
            "project.toml": designed_text(self.project, self.design, folder_given(folder)),
        }

    def save(self, folder: str | Path) -> None:
        """Write design.json and project.toml with the gains into `folder`."""
        save(self.files(folder), folder_given(folder))

    def _repr_html_(self) -> str:
        return notebook([*controller_section(self.design, self.loop, None), *tuning_section(self.tuned)])


def design(source: Project | Identified, *, stage: Stage = quietly) -> Designed:
    """Tune the controller or take its gains, and close the loop on paper.

    Parameters
    ----------
    source
        a project with `[controller]` and `[signals]`, or what `identify` made of it: then the fitted plant is taken

    Raises
    ------
    ProjectError
        when a part of the project is missing or wrong, or nothing is found that meets what is asked.
    """
    check_noun("design", source, Project, Identified)
    project = source if isinstance(source, Project) else source.project
    require(project, "controller", "signals")
    plant = plant_given(source)
    with stage("designing the controller"):
        made = making.design(project, plant)
        loop = analyze(project, made, plant) if plant else None
    with stage("tuning by other rules"):
        tuned = beside(project, made, plant) if plant else ()
    return Designed(project, plant, made, loop, tuned)


def plant_given(source: Project | Identified) -> Plant | None:
    """Return the fitted plant, else the project's; None where it has none."""
    if isinstance(source, Identified):
        return source.plant
    return plant_of(source) if source.plant else None
