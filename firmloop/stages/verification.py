"""Run the C on this machine and on each target, against the reference."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import load_target
from firmloop.design.design import Bench, Design
from firmloop.design.law import Law
from firmloop.design.models.feedforward import position_of
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.compiler import ToolError
from firmloop.identify.simulation.fmu_plant import FmuPlant
from firmloop.identify.simulation.stepped import SteppedPlant, with_place, with_states
from firmloop.project.project import Campaign, Project
from firmloop.project.table import ProjectError
from firmloop.stages.making import Generated
from firmloop.stages.plant import located
from firmloop.stages.progress import Report
from firmloop.verify.link import LinkError
from firmloop.verify.proofs.closed_loop import PlantLoop
from firmloop.verify.run import verify_on
from firmloop.verify.trial import Trial, try_out
from firmloop.verify.verdict import Verdict

Array = NDArray[np.float64]

LOOP_STEPS = 1000  # of the closed-loop run on a target, one exchange each


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
    loop = loop_of(project, designed, plant)
    if campaign.fmu is not None and loop is not None:
        loop = replace(loop, begin=partial(FmuPlant, campaign.fmu), says=campaign.fmu.name)
    try:
        verdict = verify_on(trial, target, port, report, loop)
    except (ToolError, LinkError) as error:
        return Outcome(target.name, None, str(error))
    proofs = generated.checked.judgements if generated.checked is not None else ()
    return Outcome(target.name, replace(verdict, proofs=proofs), "")


def loop_of(project: Project, designed: Design, plant: Plant | None) -> PlantLoop | None:
    """Return what the target's closed-loop run follows: two steps of the reference, up and down, against the plant.

    The plant is the one that the controller was designed for: after `run`, with the values that the fit found.
    A controller that is given the plant's states and no reference brings them where it wants them. None where there is
    no plant, or none that can be moved step by step, or no one reference to follow.
    """
    law = designed.law
    if plant is None:
        return None
    if designed.bench is not None:
        return _on_bench(law, designed.bench)
    if len(law.inputs) < 2 or not law.paired:
        return None
    names = [law.inputs[k].name for k in law.states]
    reference, measurement = reference_and_measurement(law.inputs)
    if len(law.states) == len(law.inputs) == len(plant.states):
        return _stepped(law, _with_states(plant, np.full(LOOP_STEPS, math.nan), ("", ""), names))
    told = law.inputs[reference]
    if not math.isfinite(told.high - told.low):
        return None
    course = _steps(told)
    assert project.controller is not None, "there is a design"
    position = position_of(project.controller.settings)
    roles = (told.name, law.inputs[measurement].name)
    if position is not None:
        try:
            plant, place = with_place(plant)
        except IdentifyError:
            return None
        return _stepped(law, PlantLoop(plant, course, roles, ((position, place),)))
    if len(names) == len(plant.states):
        return _stepped(law, _with_states(plant, course, (told.name, ""), names))
    return _stepped(law, PlantLoop(plant, course, roles))


def check_fmu(project: Project, designed: Design, plant: Plant | None, campaign: Campaign, fmu: Path) -> None:
    """Refuse an FMU that cannot be the plant of the project's loop, before minutes of work.

    Raises
    ------
    ProjectError
        when the project closes no loop, or no target does.
    IdentifyError, ToolError
        when the FMU cannot be that plant, or FMPy is not there.
    """
    loop = loop_of(project, designed, plant)
    if loop is None:
        raise ProjectError(
            f"{project.path}: it closes no loop that an FMU could be the plant of: give it a [plant] with the FMU's "
            "inputs and outputs, and a controller with a reference to follow"
        )
    if all("library" in load_target(name).links for name in campaign.targets):
        raise ProjectError(
            f"{project.path}: the loop is closed on emulated cores and on boards, and {', '.join(campaign.targets)} is "
            "none: name one with --target, such as qemu_mps2_an386"
        )
    FmuPlant(fmu, loop.plant, designed.law.period)


def _steps(told: Signal) -> Array:
    """Return a step up and one down, a quarter of the range apart around its middle."""
    middle, span = (told.low + told.high) / 2.0, told.high - told.low
    course = np.full(LOOP_STEPS, middle + span / 8.0)
    course[LOOP_STEPS // 2 :] = middle - span / 8.0
    return course


def _on_bench(law: Law, bench: Bench) -> PlantLoop | None:
    """Return the loop of a controller whose inputs carry what its bench shows by their names."""
    told = next(wire for wire in law.inputs if wire.name == bench.told)
    return _stepped(law, PlantLoop(bench.plant, _steps(told), (bench.told, ""), bench.read_by(law.inputs)))


def _with_states(plant: Plant, course: Array, roles: tuple[str, str], names: Sequence[str]) -> PlantLoop:
    """Return the loop of a controller whose inputs `names` carry the plant's states."""
    first = len(plant.outputs)
    return PlantLoop(with_states(plant), course, roles, tuple((name, first + k) for k, name in enumerate(names)))


def _stepped(law: Law, loop: PlantLoop) -> PlantLoop | None:
    """Return the loop, or None where its plant cannot be moved step by step."""
    try:
        SteppedPlant(loop.plant, law.period)
    except IdentifyError:
        return None
    return loop
