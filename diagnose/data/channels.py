"""Refuse channels that no plant could have produced: a sensor that dies half-way, nothing at all."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.checks import check_rows
from firmloop.diagnose.policy import DEAD_SHARE, MOTION_MEANWHILE
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.own_values import own_start
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import course_of, measured, simulator

Array = NDArray[np.float64]


def check_sound(plant: Plant, train: Sequence[Recording], test: Sequence[Recording]) -> None:
    """Raise IdentifyError at the first channel that is not sound, with its rows and the way out."""
    check_rows(plant, train, test)
    for recording in (*train, *test):
        _check_dead(plant, recording, measured(plant, recording))


def _check_dead(plant: Plant, recording: Recording, values: Array) -> None:
    """Look for an output that stands still for long although the nominal plant moves: not at rest, nor at a limit."""
    constants = np.array([p.value for p in plant.parameters])
    if np.any(np.isnan(constants)):
        return
    engine = simulator(plant, recording.hold)
    simulated = engine.run(course_of(plant, recording), constants, own_start(plant, recording, constants))
    if not np.all(np.isfinite(simulated)):
        return
    for k, signal in enumerate(plant.outputs):
        column, model = values[:, k], simulated[:, k]
        if np.ptp(column) == 0.0:
            continue  # friction or a dead zone holds it, see `dead_outputs`
        ends = [0, *(np.flatnonzero(np.diff(column) != 0.0) + 1), len(column)]
        first, last = max(pairwise(ends), key=lambda run: run[1] - run[0])
        held, moves = column[first], model[first:last]
        whole = float(np.ptp(model))
        crossed = float(np.min(moves)) < held < float(np.max(moves)) or held == 0.0
        if held != 0.0 and abs(held) == np.max(np.abs(column)):
            continue  # a sensor at its limit
        if (
            last - first > DEAD_SHARE * len(column)
            and float(np.ptp(moves)) > MOTION_MEANWHILE * whole > 0.0
            and crossed
        ):
            steps = np.diff(np.unique(column))
            if len(steps) and float(np.max(np.abs(moves - held))) < float(steps.min()):
                continue  # a sensor whose steps are wider than what moves there
            raise IdentifyError(
                f"{recording.source}: column {signal.name} stands at {held:g} from {recording.time[first]:.4g} s to "
                f"{recording.time[last - 1]:.4g} s while {plant.inputs[0].name} goes on moving the plant; the sensor "
                "or its wire is dead there: check it, and cut the recording before that"
            )
