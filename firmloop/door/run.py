"""Walk from a project's recordings to its verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.door.design import Designed, design
from firmloop.door.generate import Code, generate_for
from firmloop.door.given import asked_campaign, check_noun, folder_given
from firmloop.door.identify import Identified, identify
from firmloop.door.verify import Tell, Verified, check_targets, silent, verify_for
from firmloop.output import VERDICTS, save_over
from firmloop.presentation.notebook import notebook
from firmloop.presentation.report import Walk, report, walk_sections
from firmloop.project.extent import SEED, STEPS
from firmloop.project.project import Project, require
from firmloop.stages.plant import command_of
from firmloop.stages.progress import Stage, quietly


@dataclass(frozen=True, slots=True)
class Run:
    """A whole walk: what each of its four functions returned."""

    identified: Identified
    designed: Designed
    code: Code
    verified: Verified

    @property
    def agrees(self) -> bool:
        """Whether every target was run and no bit differs."""
        return self.verified.agrees

    @property
    def walk(self) -> Walk:
        """The walk as its report takes it."""
        project, made = self.code.project, self.designed
        return Walk(
            project,
            command_of("run", project.path),
            self.identified.data,
            self.identified.fit,
            made.design,
            made.loop,
            self.code.generated,
            self.verified.outcomes,
            made.tuned,
            self.verified.tracking,
        )

    def files(self, folder: str | Path) -> Mapping[str, str]:
        """Return the text of project.toml as it may stand in `folder`, of the C, the verdicts and report.html."""
        return {**self.identified.files(folder), **self.verified.files(), "report.html": report(self.walk)}

    def save(self, folder: str | Path) -> None:
        """Write all of it into `folder`, in the place of an older run."""
        save_over(self.files(folder), folder_given(folder), VERDICTS)

    def _repr_html_(self) -> str:
        return notebook(walk_sections(self.walk))


def run(
    project: Project | Identified,
    *,
    targets: str | Sequence[str] = (),
    steps: int = STEPS,
    seed: int = SEED,
    port: str | None = None,
    fmu: str | Path | None = None,
    wires: Mapping[str, str] | None = None,
    stage: Stage = quietly,
    tell: Tell = silent,
) -> Run:
    """Identify, design, generate and verify.

    Parameters
    ----------
    project
        a project with `[recordings]`, `[plant]`, `[controller]`, `[signals]` and `[arithmetic]`, or what `identify`
        made of it
    targets, steps, seed, port, fmu, wires
        as `verify` takes them: an FMU closes the loop in the place of the fitted plant
    tell
        called with each noun as soon as it is there: Identified, Designed, Code, Tracking, Outcome

    Raises
    ------
    ProjectError
        when a part of the project, the name of a target or a number is wrong.
    IdentifyError
        when a recording cannot be used, or says too little.
    ToolError
        when the C compiler that the simulator needs is not installed.
    """
    check_noun("run", project, Project, Identified)
    identified = project if isinstance(project, Identified) else None
    project = project.project if isinstance(project, Identified) else project
    require(project, "recordings", "plant", "controller", "signals", "arithmetic")
    campaign = asked_campaign(project, targets, steps, seed, port, fmu, wires)
    check_targets(project, campaign)
    identified = identified or identify(project, stage=stage)
    tell(identified)
    designed = design(identified, stage=stage)
    tell(designed)
    code = generate_for("run", designed, stage)
    tell(code)
    return Run(identified, designed, code, verify_for(campaign, code, identified.data, stage, tell))
