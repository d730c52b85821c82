"""Predict a recording's outputs from its input."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.checks.spikes import failed_readings
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.own_values import fit_start, own_start, own_value
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, column, make_recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.fmu_plant import Fmu, FmuPlant
from firmloop.identify.simulation.simulate import constants_of, simulate
from firmloop.identify.units import unit_of
from firmloop.project.project import Project
from firmloop.stages.data import conditioning_of
from firmloop.stages.plant import located, recorded_plant_of

Array = NDArray[np.float64]

EVEN = 1e-6  # of the usual step: what the last digit of a time stamp adds
Start = Callable[[Project, Plant, Recording], Array | None]  # chooses the initial state; None is at rest


def predicted(project: Project, recording: Recording, start: Start, fitted: Plant | None = None) -> Recording:
    """Replace every output of the fitted plant, else of the project's, by its simulation.

    Columns whose numbers are the file's keep its names.
    """
    with located(project):
        plant = recorded_plant_of(project, fitted)
        begun = start(project, plant, recording)
        simulated = simulate(plant, recording, begun)
    made = _with_outputs(project, recording, [signal.name for signal in plant.outputs], simulated)
    own = () if begun is None else _own(plant, begun)
    return replace(made, notes=(*own, *_failed_inputs(plant, recording)))


def _failed_inputs(plant: Plant, recording: Recording) -> tuple[str, ...]:
    """Tell readings of an input that failed: what is predicted from there on follows from them."""
    inputs = [signal.name for signal in plant.inputs]
    said = failed_readings(Evidence(plant, (recording,), NONE, None))
    return tuple(f"{each}; all that is predicted behind it follows from it" for name, each in said if name in inputs)


def predicted_by(fmu: Fmu, project: Project, recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Replace the outputs of an FMU by what it says, from its own start; return their names too.

    They are those of `[plant]`, where there is one; else all that it has, and its inputs are those that have a column.
    It holds its inputs from row to row.

    Raises
    ------
    IdentifyError
        when the FMU cannot be that plant, or has no input in the recording.
    ToolError
        when FMPy is not there.
    """
    if recording.hold != "zero_order":
        raise IdentifyError(
            f"recordings.hold is {recording.hold!r}, and an FMU holds its inputs from row to row: leave it out"
        )
    inputs, outputs, notes = _ends(fmu, project, recording)
    fmu.check_names([signal.name for signal in (*inputs, *outputs)])
    driven = np.column_stack([column(recording, signal.name) for signal in inputs])
    time = recording.time - recording.time[0]
    lengths = np.diff(time)
    usual = float(np.median(lengths))
    even = bool(np.all(np.abs(lengths - usual) <= EVEN * usual))
    model = FmuPlant(fmu, inputs, outputs, usual)
    if not even and not model.takes_any_step:
        raise IdentifyError(
            f"{recording.source}: its rows are {lengths.min():.6g} to {lengths.max():.6g} s apart, and "
            f"{fmu.file.name} takes even steps alone: give it a recording with even rows"
        )
    seen = np.empty((len(time), len(outputs)))
    for k, values in enumerate(driven):
        seen[k] = model.read()
        if k == len(lengths):
            break
        if even:
            model.apply(values)
        else:
            model.step(values, float(time[k]), float(lengths[k]))
    names = [signal.name for signal in outputs]
    return replace(_with_outputs(project, recording, names, seen), notes=notes), tuple(names)


def _ends(
    fmu: Fmu, project: Project, recording: Recording
) -> tuple[Sequence[Signal], Sequence[Signal], tuple[str, ...]]:
    """Return inputs and outputs by the names of our columns, and what is to be told."""
    if project.plant is not None:
        plant = recorded_plant_of(project)
        return plant.inputs, plant.outputs, ()
    ours = {variable: name for name, variable in fmu.names.items()}
    inputs, outputs = ([ours.get(name, name) for name in names] for names in fmu.ends())
    driven = [name for name in inputs if name in recording.columns]
    if not driven:
        raise IdentifyError(
            f"{fmu.file}: none of its inputs ({', '.join(map(fmu.called, inputs)) or 'none'}) is a column of "
            f"{recording.source}, which has {', '.join(recording.columns)}: say which one it is with "
            "--wire COLUMN=VARIABLE"
        )
    still = [f"{fmu.called(name)} of {fmu.file.name} has no column and keeps its start" for name in inputs]
    notes = tuple(note for name, note in zip(inputs, still, strict=True) if name not in driven)
    made = [[Signal(name, unit_of(name), -math.inf, math.inf) for name in names] for names in (driven, outputs)]
    return made[0], made[1], notes


def _with_outputs(project: Project, recording: Recording, names: Sequence[str], simulated: Array) -> Recording:
    """Return a recording with the outputs (n, r) of these names in it."""
    columns = {**recording.columns, **dict(zip(names, simulated.T, strict=True))}
    rules = project.recordings.rename if project.recordings else {}
    foreign = {rule.name: name for name, rule in rules.items() if rule.is_a_name}
    named = {foreign.get(name, name): values for name, values in columns.items()}
    return make_recording(recording.time, named, recording.source, recording.sha256)


def _own(plant: Plant, start: Array) -> tuple[str, ...]:
    """Tell what the recording has of its own: no input column tells that."""
    values = [own_value(plant, one, start, math.nan) for one in plant.varying]
    return tuple(
        f"{one.name} is {one.value:.5g} {one.unit or '1'} in this recording, by its own readings" for one in values
    )


def at_rest(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start at rest, at the first recorded position, with what the recording has of its own.

    Where no input ever changes, start where the readings say.
    """
    return own_start(plant, recording, constants_of(plant))


def as_recorded(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start where the recorded outputs fit best."""
    return fit_start(plant, recording, constants_of(plant), conditioning_of(project))
