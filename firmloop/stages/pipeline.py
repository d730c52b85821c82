"""The whole walk, recording to verdict: one function per stage, noun in and noun out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import load_target
from firmloop.design.analysis.loop import (
    Margins,
    StepMetrics,
    Trajectory,
    closed_loop,
    margins,
    step_metrics,
    step_profile,
)
from firmloop.design.analysis.uncertainty import figures_of, half_widths
from firmloop.design.design import Design
from firmloop.design.kinds import design as design_law
from firmloop.design.law import DesignError, Horizon, Law, Scalar
from firmloop.design.models.feedforward import position_of
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import Fit, fit, fit_start
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE, Conditioning, conditioning_from_table
from firmloop.identify.recordings.recording import Recording, make_recording, read_recording
from firmloop.identify.simulation.compiler import ToolError
from firmloop.identify.simulation.linearize import Linear, linearize
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.stepped import SteppedPlant, with_place, with_states
from firmloop.project.project import Campaign, Project
from firmloop.project.project_text import settled
from firmloop.quantize.lower.word_length import lower_within
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.twins.qp import optimum
from firmloop.stages.making import Generated, command_of, design, formats_of, generate, located, plant_of
from firmloop.stages.saturation import cut_input, cut_output, saturated
from firmloop.verify.link import LinkError
from firmloop.verify.proofs.closed_loop import PlantLoop
from firmloop.verify.replay import Controller
from firmloop.verify.run import verify_on
from firmloop.verify.trial import Trial, try_out
from firmloop.verify.verdict import Verdict

__all__ = ["Generated", "command_of", "design", "generate", "located", "plant_of"]  # the first half of the walk

Array = NDArray[np.float64]
Report = Callable[[float, str], None]  # told the share of the work that is done, and what is being done
Start = Callable[[Project, Plant, Recording], Array | None]  # chooses the initial state; None is at rest

LOOP_STEPS = 1000  # of the closed-loop run on a target, one exchange each


@dataclass(frozen=True, slots=True)
class Data:
    """The recordings a project names, read and checked."""

    train: tuple[Recording, ...]
    test: tuple[Recording, ...]


@dataclass(frozen=True, slots=True)
class Loop:
    """How a law and a plant get on with each other."""

    margins: Margins
    step: Trajectory
    metrics: StepMetrics
    halves: Mapping[str, float]  # of 95 % intervals of both, by field, from those of the plant's parameters
    points: tuple[tuple[str, Margins], ...]  # at each operating point, where the controller has several


@dataclass(frozen=True, slots=True)
class Outcome:
    """One target: its verdict, or why it could not be run."""

    target: str
    verdict: Verdict | None
    not_run: str


def read_data(project: Project) -> Data:
    """Read every recording the project names."""
    named = project.recordings
    assert named is not None, "require() has seen to it"
    return Data(
        tuple(read_recording(path, named.rename, named.hold) for path in named.train),
        tuple(read_recording(path, named.rename, named.hold) for path in named.test),
    )


def identify(project: Project, data: Data, report: Report) -> Fit:
    """Fit the plant to the train recordings; score it on train and test."""
    assert project.recordings is not None, "require() has seen to it"
    with located(project):
        fitted = fit(plant_of(project), data.train, data.test, conditioning_of(project), report)
    seen = (saturated(project, data.train) or cut_input(project, data.train), cut_output(project, data.train))
    return replace(fitted, warnings=(*fitted.warnings, *filter(None, seen)))


def conditioning_of(project: Project) -> Conditioning:
    """Read `[recordings.conditioning]`; nothing is done where there is none."""
    if project.recordings is None:
        return NONE
    with located(project):
        return conditioning_from_table(project.recordings.conditioning.values)


def predicted(project: Project, recording: Recording, start: Start) -> Recording:
    """Replace every output of the plant by its simulation; the columns keep the names they have in the file."""
    with located(project):
        plant = plant_of(project)
        simulated = simulate(plant, recording, start(project, plant, recording))
    columns = dict(recording.columns)
    for index, signal in enumerate(plant.outputs):
        columns[signal.name] = simulated[:, index]
    foreign = {ours: name for name, ours in project.recordings.rename.items()} if project.recordings else {}
    named = {foreign.get(name, name): values for name, values in columns.items()}
    return make_recording(recording.time, named, recording.source, recording.sha256)


def at_rest(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start at rest, at the first recorded position."""
    return None


def as_recorded(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start where the recorded outputs fit best."""
    return fit_start(plant, recording, conditioning_of(project))


def analyze(project: Project, designed: Design, plant: Plant) -> Loop | None:
    """Close the loop on paper: margins, and a step of the reference.

    None where the controller has no reference, or follows the plant's own equations, which are not linear.
    """
    solve = designed.law.solve
    if len(designed.law.inputs) < 2 or (solve is not None and isinstance(solve.problem, Horizon)):
        return None
    with located(project):
        linear = linearize(plant)
        law, profile = designed.law, step_profile(designed.law, linear)
        step = closed_loop(law, linear, profile, optimum)

        def figures(moved: Linear) -> Mapping[str, float]:
            measured = () if law.solve else (step_metrics(closed_loop(law, moved, profile)),)  # seconds for a search
            return figures_of(margins(law, moved), *measured)

        points = tuple((one.says, margins(one.law, linearize(one.plant))) for one in designed.operating)
        return Loop(margins(law, linear), step, step_metrics(step), half_widths(plant, figures), points)


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
    project: Project, designed: Design, trial: Trial, name: str, campaign: Campaign, report: Report
) -> Outcome:
    """Run the C on one target against the reference; a target that is not there is an outcome too."""
    with located(project):
        target = load_target(name)
    port = campaign.port if "library" not in target.links else None
    try:
        verdict = verify_on(trial, target, port, report, loop_of(project, designed))
    except (ToolError, LinkError) as error:
        return Outcome(target.name, None, str(error))
    return Outcome(target.name, verdict, "")


def loop_of(project: Project, designed: Design) -> PlantLoop | None:
    """Return what the target's closed-loop run follows: two steps of the reference, up and down, against the plant.

    A controller that is given the plant's states and no reference brings them where it wants them. None where there is
    no plant, or none that can be moved step by step, or no reference to follow.
    """
    if project.plant is None:
        return None
    plant, law = plant_of(project), designed.law
    if len(law.inputs) < 2:
        return None
    names = [law.inputs[k].name for k in law.states]
    reference, measurement = reference_and_measurement(law.inputs)
    if len(law.states) == len(law.inputs) == len(plant.states):
        return _stepped(law, _with_states(plant, np.full(LOOP_STEPS, math.nan), ("", ""), names))
    told = law.inputs[reference]
    middle, span = (told.low + told.high) / 2.0, told.high - told.low
    if not math.isfinite(span):
        return None
    course = np.full(LOOP_STEPS, middle + span / 8.0)
    course[LOOP_STEPS // 2 :] = middle - span / 8.0
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


def recorded_inputs(project: Project, data: Data, most: int) -> tuple[Mapping[str, Array], ...]:
    """Return what the controller would have seen: each recording held at the controller's period, `most` samples.

    The measurement is the plant's first output; the reference is a recorded `reference_*` in the same unit.
    """
    if project.plant is None or project.controller is None:
        return ()
    inputs = {signal.name for signal in project.controller_inputs}
    period, measured = project.controller.period, project.plant.outputs[0]
    unit = measured.partition("_")[2]
    played = []
    for recording in (*data.train, *data.test):
        wanted = {"measurement": measured, "reference": f"reference_{unit}"}
        time = recording.time - recording.time[0]
        count = min(int(time[-1] / period) + 1, most)
        rows = np.searchsorted(time, np.arange(count) * period * (1 + 1e-12), side="right") - 1
        held = {name: recording.columns[column][rows] for name, column in wanted.items() if column in recording.columns}
        signals = {name: values for name, values in held.items() if name in inputs}
        if signals:
            played.append(signals)
    return tuple(played)


def controller_of(project: Project) -> Controller | None:
    """Return the project's controller, to be played again on what a recording says it was given; None without one.

    A controller that cannot be designed is none: to diagnose a plant needs no controller.
    """
    part = project.controller
    if part is None or not project.signals or len(project.controller_outputs) == 0:
        return None
    plant = plant_of(project) if project.plant else None

    def made(table: Mapping[str, object], period: float, limits: tuple[float, float] | None) -> Design | None:
        outputs = project.controller_outputs
        if limits is not None:
            outputs = (replace(outputs[0], low=limits[0], high=limits[1]), *outputs[1:])
        try:
            return design_law(
                part.kind, project.name, table, period, project.controller_inputs, outputs, plant, optimum
            )
        except DesignError:
            return None

    designed = made(part.settings, part.period, None)
    if designed is None or not _plain(designed.law):
        return None
    try:
        program = lower_within(designed.law, formats_of(project), project.allowed, project.rounds)
        wires = reference_and_measurement(designed.law.inputs)
    except (QuantizeError, DesignError):
        return None
    told = settled(part.settings, designed)
    found = [key for key in told if key not in part.settings]
    defaults = []
    for key in found:
        other = made({name: value for name, value in told.items() if name != key}, part.period, None)
        if other is not None and other.gains.get(key) == designed.gains.get(key):
            defaults.append(key)
    tuned = tuple(key for key in found if key not in defaults)

    def rebuild(table: Mapping[str, object], period: float, limits: tuple[float, float] | None) -> Law | None:
        changed = made(table, period, limits)
        return changed.law if changed is not None and _plain(changed.law) else None

    return Controller(designed.law, program, told, tuple(defaults), tuned, wires, rebuild)


def _plain(law: Law) -> bool:
    """Whether a law is one stage of straight arithmetic, which can be played fast."""
    return len(law.stages) == 1 and isinstance(law.stages[0], Scalar)


def available_data(project: Project) -> Data:
    """Read those recordings that are there: stimuli for a verification, which does not need them."""
    named = project.recordings
    if named is None or project.plant is None:
        return Data((), ())
    return Data(tuple(read_recording(p, named.rename) for p in (*named.train, *named.test) if p.is_file()), ())
