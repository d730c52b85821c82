"""Turn a project's controller into C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from firmloop.design.design import Design
from firmloop.door.design import Designed, plant_given
from firmloop.door.given import check_noun, folder_given
from firmloop.door.identify import Identified
from firmloop.identify.plants.plant import Plant
from firmloop.output import save
from firmloop.presentation.documents import c_files
from firmloop.presentation.notebook import notebook
from firmloop.presentation.sections import code_section
from firmloop.project.project import Project, require
from firmloop.quantize.program import Program
from firmloop.stages import making
from firmloop.stages.analysis import runs_away
from firmloop.stages.making import Generated
from firmloop.stages.plant import command_of
from firmloop.stages.progress import Stage, quietly


@dataclass(frozen=True, slots=True)
class Code:
    """A controller as exact arithmetic and as C.

    Attributes
    ----------
    project, plant, design
        where it comes from; the plant is None where the project has none
    generated
        program, bundle, manifest, proof and package
    unstable
        whether the loop around the plant is unstable, where no `design` has told it before
    not_judged
        why that cannot be told, as where the plant has no slope at rest; blank where it can
    """

    project: Project
    plant: Plant | None
    design: Design
    generated: Generated
    unstable: bool = False
    not_judged: str = ""

    @property
    def program(self) -> Program:
        """The promise: operations over bounded values, each with unit, range and fraction bits."""
        return self.generated.program

    @property
    def files(self) -> Mapping[str, str]:
        """The text of every file by its name: sources, headers, manifest, proof, test, build files."""
        return c_files(self.generated)

    def save(self, folder: str | Path) -> None:
        """Write every file into `folder`."""
        save(self.files, folder_given(folder))

    def _repr_html_(self) -> str:
        return notebook(code_section(self.generated))


def generate(source: Project | Identified | Designed, *, stage: Stage = quietly) -> Code:
    """Turn the law into exact arithmetic with proven ranges, and that into C99.

    Parameters
    ----------
    source
        a project with `[controller]`, `[signals]` and `[arithmetic]`, or what `identify` or
        `design` made of it

    Raises
    ------
    ProjectError
        when a part of the project is missing or wrong, or no number format is safe.
    """
    check_noun("generate", source, Project, Identified, Designed)
    return generate_for("generate", source, stage)


def generate_for(verb: str, source: Project | Identified | Designed, stage: Stage) -> Code:
    """Generate; the C names `firmloop VERB` as the command that makes it again."""
    project = source if isinstance(source, Project) else source.project
    require(project, "controller", "signals", "arithmetic")
    if isinstance(source, Designed):
        plant, design = source.plant, source.design
    else:
        plant = plant_given(source)
        design = making.design(project, plant)
    with stage("generating C"):
        made = making.generate(project, design, command_of(verb, project.path))
        loop = (False, "") if isinstance(source, Designed) else runs_away(project, design, plant)
        return Code(project, plant, design, made, *loop)
