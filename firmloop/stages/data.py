"""Read the recordings that a project names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.conditioning import NONE, Conditioning, conditioning_from_table
from firmloop.identify.recordings.recording import Recording, read_recording
from firmloop.project.project import Project
from firmloop.stages.plant import located

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Data:
    """The recordings a project names, read and checked."""

    train: tuple[Recording, ...]
    test: tuple[Recording, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """How the files were read, where they are not plain."""
        return tuple(note for recording in (*self.train, *self.test) for note in recording.notes)


def read_data(project: Project) -> Data:
    """Read every recording the project names."""
    named = project.recordings
    assert named is not None, "require() has seen to it"
    return Data(*(tuple(read_as_named(project, path) for path in part) for part in (named.train, named.test)))


def read_as_named(project: Project, path: Path) -> Recording:
    """Read one file as `[recordings]` says; plainly where there is none."""
    named = project.recordings
    if named is None:
        return read_recording(path, {})
    return read_recording(path, named.rename, named.hold, named.clock)


def conditioning_of(project: Project) -> Conditioning:
    """Read `[recordings.conditioning]`; nothing is done where there is none."""
    if project.recordings is None:
        return NONE
    with located(project):
        return conditioning_from_table(project.recordings.conditioning.values)


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


def available_data(project: Project) -> Data:
    """Read those recordings that are there: stimuli for a verification, which does not need them."""
    named = project.recordings
    if named is None or project.plant is None:
        return Data((), ())
    return Data(tuple(read_as_named(project, p) for p in (*named.train, *named.test) if p.is_file()), ())
