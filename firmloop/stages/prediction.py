"""Predict a recording's outputs from its input."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.fit import fit_start
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.project.project import Project
from firmloop.stages.data import conditioning_of
from firmloop.stages.plant import located, plant_of

Array = NDArray[np.float64]
Start = Callable[[Project, Plant, Recording], Array | None]  # chooses the initial state; None is at rest


def predicted(project: Project, recording: Recording, start: Start) -> Recording:
    """Replace every output of the plant by its simulation; columns whose numbers are the file's keep its names."""
    with located(project):
        plant = plant_of(project)
        simulated = simulate(plant, recording, start(project, plant, recording))
    columns = dict(recording.columns)
    for index, signal in enumerate(plant.outputs):
        columns[signal.name] = simulated[:, index]
    rules = project.recordings.rename if project.recordings else {}
    foreign = {rule.name: name for name, rule in rules.items() if rule.is_a_name}
    named = {foreign.get(name, name): values for name, values in columns.items()}
    return make_recording(recording.time, named, recording.source, recording.sha256)


def at_rest(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start at rest, at the first recorded position."""
    return None


def as_recorded(project: Project, plant: Plant, recording: Recording) -> Array | None:
    """Start where the recorded outputs fit best."""
    return fit_start(plant, recording, conditioning_of(project))
