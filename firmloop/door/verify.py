"""Build a project's C for each target and hold it against the reference, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.target import load_target
from firmloop.door.design import Designed
from firmloop.door.generate import Code, generate
from firmloop.door.given import asked_campaign, check_noun, folder_given
from firmloop.door.identify import Identified
from firmloop.identify.simulation.compiler import ToolError
from firmloop.output import VERDICTS, save_over
from firmloop.presentation.documents import as_json
from firmloop.presentation.figures import LIMIT, search_figure
from firmloop.presentation.notebook import notebook
from firmloop.presentation.sections import targets_section, verdict_cards
from firmloop.project.extent import SEED, STEPS
from firmloop.project.project import Campaign, Project
from firmloop.project.table import ProjectError
from firmloop.stages.baseline import cost_document
from firmloop.stages.data import Data, available_data, recorded_inputs
from firmloop.stages.loops import check_fmu
from firmloop.stages.plant import located
from firmloop.stages.progress import Stage, quietly
from firmloop.stages.tracking import Tracking, tracking
from firmloop.stages.verification import Outcome, try_here, verify_target
from firmloop.verify.trial import Trial
from firmloop.verify.verdict import Verdict

Tell = Callable[[object], None]  # is given each noun as soon as it is there


@dataclass(frozen=True, slots=True)
class Verified:
    """What each target makes of a controller's C.

    Attributes
    ----------
    code
        what was verified
    outcomes
        a target each: its verdict, or why it could not be run
    tracking
        a wave followed with and without the feedforward; None where there is none
    not_tracked
        why the wave was not followed though there is a feedforward; empty where it was
    """

    code: Code
    outcomes: tuple[Outcome, ...]
    tracking: Tracking | None
    not_tracked: str

    @property
    def verdicts(self) -> Mapping[str, Verdict]:
        """The verdict of each target that was run: steps, differences, rounding in the outputs' units, cost."""
        return {outcome.target: outcome.verdict for outcome in self.outcomes if outcome.verdict}

    @property
    def agrees(self) -> bool:
        """Whether every target was run and no bit differs."""
        return all(outcome.verdict is not None and outcome.verdict.agrees for outcome in self.outcomes)

    def files(self) -> Mapping[str, str]:
        """Return the text of the C, of each verdict, and of cost.json."""
        return {**self.code.files, **verdict_files(self.outcomes)}

    def save(self, folder: str | Path) -> None:
        """Write the C and the verdicts into `folder`, in the place of older ones."""
        save_over(self.files(), folder_given(folder), VERDICTS)

    def _repr_html_(self) -> str:
        return notebook([verdict_cards(self.outcomes), *targets_section(self.outcomes, self.code.design)])


def silent(noun: object) -> None:
    """Tell nobody."""


def verify(
    source: Project | Identified | Designed | Code,
    *,
    targets: str | Sequence[str] = (),
    steps: int = STEPS,
    seed: int = SEED,
    port: str | None = None,
    fmu: str | Path | None = None,
    wires: Mapping[str, str] | None = None,
    stage: Stage = quietly,
    tell: Tell = silent,
) -> Verified:
    """Build the C, run it on every target, and compare each step with the bit-exact reference.

    Parameters
    ----------
    source
        a project with `[controller]`, `[signals]` and `[arithmetic]`, or what `identify`, `design` or `generate` made
        of it
    targets
        a target or several: names, or paths of their TOML files; where none is given, those of the project, else
        the host
    steps
        steps per target
    seed
        of the noise stimuli
    port
        where the board is, such as /dev/ttyACM0, COM3, socket://host:port
    fmu, wires
        a co-simulation FMU that closes the loop in the place of the equations of `[plant]`, or without one; and, by
        our signal, what it calls those that it has under another name: the plant's, or the controller's. A variable
        with a unit is converted. It is a program of whoever made it, and runs in this process
    tell
        called with each noun as soon as it is there: Code, Tracking, Outcome

    Raises
    ------
    ProjectError
        when a part of the project, the name of a target or a number is wrong.
    IdentifyError
        when the FMU cannot be the plant.
    ToolError
        when no target could be run.
    """
    check_noun("verify", source, Project, Identified, Designed, Code)
    project = source if isinstance(source, Project) else source.project
    campaign = asked_campaign(project, targets, steps, seed, port, fmu, wires)
    check_targets(project, campaign)
    if not isinstance(source, Code):
        source = generate(source, stage=stage)
        tell(source)
    found = verify_for(campaign, source, available_data(project), stage, tell)
    if not found.verdicts:
        raise ToolError("; ".join(f"{outcome.target} was not run: {outcome.not_run}" for outcome in found.outcomes))
    return found


def check_targets(project: Project, campaign: Campaign) -> None:
    """Read every target's file, and what an FMU says of itself, before minutes of work: a wrong one is told at once."""
    with located(project):
        targets = [load_target(name) for name in campaign.targets]
    if campaign.fmu is None:
        return
    if all("library" in target.links for target in targets):
        raise ProjectError(
            f"{project.path}: the loop is closed on emulated cores and on boards, and {', '.join(campaign.targets)} is "
            "none: name one with --target, such as qemu_mps2_an386"
        )
    campaign.fmu.ends()


def verify_for(campaign: Campaign, code: Code, data: Data, stage: Stage, tell: Tell) -> Verified:
    """Verify on every target of the campaign; `data` holds what the controller is played besides its stimuli."""
    project, design, generated = code.project, code.design, code.generated
    found, why = None, ""
    if campaign.fmu is not None:
        check_fmu(campaign.fmu, project, design, code.plant)
    with stage("following a wave"):
        try:
            found = tracking(project, design, generated.program, code.plant)
        except ToolError as error:
            why = str(error)
    if found is not None:
        tell(found)
    recorded = recorded_inputs(project, data, campaign.steps)
    with stage("verifying on this machine") as report:
        trial = try_here(project, design, generated, campaign, recorded, report)
    outcomes: list[Outcome] = []
    for name in campaign.targets:
        if isinstance(trial, Trial):
            with stage(f"verifying on {name}") as report:
                outcome = verify_target(project, design, code.plant, code.generated, trial, name, campaign, report)
        else:
            outcome = trial[len(outcomes)]
        tell(outcome)
        outcomes.append(outcome)
    return Verified(code, tuple(outcomes), found, why)


def verdict_files(outcomes: Sequence[Outcome]) -> dict[str, str]:
    """One file a target, and one more where it searched; cost.json holds all costs.

    verdict.json is the first that differs, else the last.
    """
    verdicts = [outcome.verdict for outcome in outcomes if outcome.verdict]
    files = {f"verdict_{verdict.target}.json": as_json(verdict.as_dict()) for verdict in verdicts}
    if verdicts:
        shown = next((verdict for verdict in verdicts if not verdict.agrees), verdicts[-1])
        files["verdict.json"] = as_json(shown.as_dict())
        files["cost.json"] = as_json(cost_document(outcomes))
    return files | {f"search_{v.target}.svg": search_figure(v.searches, LIMIT) for v in verdicts if v.searches}
