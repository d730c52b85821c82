"""Run the C on this machine and on each target, against the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import load_target
from firmloop.design.design import Design
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.compiler import ToolError
from firmloop.project.project import Campaign, Project
from firmloop.stages.loops import loop_of, loop_with
from firmloop.stages.making import Generated
from firmloop.stages.plant import located
from firmloop.stages.progress import Report
from firmloop.verify.link import LinkError
from firmloop.verify.run import verify_on
from firmloop.verify.trial import Trial, try_out
from firmloop.verify.verdict import Verdict

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Outcome:
    """One target: its verdict, or why it could not be run."""

    target: str
    verdict: Verdict | None
    not_run: str


def try_here(
    project: Project,
    designed: Design,
    generated: Generated,
    campaign: Campaign,
    recorded: Sequence[Mapping[str, Array]],
    report: Report,
) -> Trial | tuple[Outcome, ...]:
    """Try the C on this machine, once for all targets; where that cannot be done, no target has a verdict."""
    with located(project):
        targets = [load_target(name).name for name in campaign.targets]
    program, bundle = generated.program, generated.bundle
    try:
        return try_out(designed.law, program, bundle, recorded, campaign.steps, campaign.seed, report)
    except (ToolError, LinkError) as error:
        return tuple(Outcome(target, None, str(error)) for target in targets)


def verify_target(
    project: Project,
    designed: Design,
    plant: Plant | None,
    generated: Generated,
    trial: Trial,
    name: str,
    campaign: Campaign,
    report: Report,
) -> Outcome:
    """Run the C on one target against the reference; a target that is not there is an outcome too."""
    with located(project):
        target = load_target(name)
    port = campaign.port if "library" not in target.links else None
    fmu = campaign.fmu
    loop = loop_of(project, designed, plant) if fmu is None else loop_with(fmu, project, designed, plant)
    try:
        verdict = verify_on(trial, target, port, report, loop)
    except (ToolError, LinkError) as error:
        return Outcome(target.name, None, str(error))
    proofs = generated.checked.judgements if generated.checked is not None else ()
    return Outcome(target.name, replace(verdict, proofs=proofs), "")
