"""Predict a recording's outputs from its input."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.own_values import fit_start, own_start, own_value
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import constants_of, simulate
from firmloop.project.project import Project
from firmloop.stages.data import conditioning_of
from firmloop.stages.plant import located, recorded_plant_of

Array = NDArray[np.float64]
Start = Callable[[Project, Plant, Recording], Array | None]  # chooses the initial state; None is at rest


def predicted(project: Project, recording: Recording, start: Start) -> Recording:
    """Replace every output of the plant by its simulation; columns whose numbers are the file's keep its names."""
    with located(project):
        plant = recorded_plant_of(project)
        begun = start(project, plant, recording)
        simulated = simulate(plant, recording, begun)
    columns = dict(recording.columns)
    for index, signal in enumerate(plant.outputs):
        columns[signal.name] = simulated[:, index]
    rules = project.recordings.rename if project.recordings else {}
    foreign = {rule.name: name for name, rule in rules.items() if rule.is_a_name}
    named = {foreign.get(name, name): values for name, values in columns.items()}
    made = make_recording(recording.time, named, recording.source, recording.sha256)
    return made if begun is None else replace(made, notes=_own(plant, begun))


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
