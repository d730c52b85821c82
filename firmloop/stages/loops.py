"""Close a loop on a target: what the run follows, and which plant moves, by its equations or as an FMU."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from firmloop.design.design import Bench, Design
from firmloop.design.law import Law
from firmloop.design.models.feedforward import position_of
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.fmu_plant import Fmu, FmuPlant
from firmloop.identify.simulation.stepped import with_place, with_states
from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.verify.proofs.closed_loop import PlantLoop

Array = NDArray[np.float64]

LOOP_STEPS = 1000  # of the closed-loop run on a target, one exchange each


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


def loop_with(fmu: Fmu, project: Project, designed: Design, plant: Plant | None) -> PlantLoop | None:
    """Return the loop that an FMU closes: in the place of the plant's equations, or where a project has no plant.

    With a plant its variables are those of the plant's inputs and outputs. Without one they are the controller's
    outputs and its measurement, and whatever else of the controller's inputs it has; where the FMU has one input, or
    one output, that is the one. None where there is no loop to close.

    Raises
    ------
    IdentifyError, ToolError
        when the FMU cannot be read, has no such variables, or FMPy is not there.
    """
    if plant is not None:
        loop = loop_of(project, designed, plant)
        return None if loop is None or loop.plant is None else _begun(loop, fmu, loop.plant.inputs, loop.plant.outputs)
    law = designed.law
    if len(law.inputs) < 2 or not law.paired or law.states or designed.bench is not None:
        return None
    told, measured = (law.inputs[k] for k in reference_and_measurement(law.inputs))
    if not math.isfinite(told.high - told.low):
        return None
    inputs, outputs = fmu.ends()
    alone = {}
    if len(inputs) == len(law.outputs) == 1:
        alone[law.outputs[0].name] = inputs[0]
    if len(outputs) == 1:
        alone[measured.name] = outputs[0]
    fmu = replace(fmu, names={**alone, **fmu.names})
    more = [wire for wire in law.inputs if wire not in (told, measured) and fmu.called(wire.name) in outputs]
    others = tuple((wire.name, 1 + k) for k, wire in enumerate(more))
    loop = PlantLoop(None, _steps(told), (told.name, measured.name), others)
    return _begun(loop, fmu, law.outputs, (measured, *more))


def _begun(loop: PlantLoop, fmu: Fmu, inputs: Sequence[Signal], outputs: Sequence[Signal]) -> PlantLoop:
    fmu.check_names([signal.name for signal in (*inputs, *outputs)])
    return replace(loop, begin=partial(FmuPlant, fmu, inputs, outputs), says=fmu.file.name)


def check_fmu(fmu: Fmu, project: Project, designed: Design, plant: Plant | None) -> None:
    """Refuse an FMU that cannot be the plant of the project's loop, before minutes of work.

    Raises
    ------
    ProjectError
        when the project closes no loop.
    IdentifyError, ToolError
        when the FMU cannot be that plant, or FMPy is not there.
    """
    loop = loop_with(fmu, project, designed, plant)
    if loop is None:
        raise ProjectError(
            f"{project.path}: it closes no loop that an FMU could be the plant of: give it a controller with a "
            "reference to follow and a measurement, such as a pid"
        )
    loop.start(designed.law.period)


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
        loop.start(law.period)
    except IdentifyError:
        return None
    return loop
