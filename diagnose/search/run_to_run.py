"""Ask what differs from run to run that a plant takes to be the same: a load, the zero or the gain of a sensor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import CLOSER_RMS, SAME_RMS
from firmloop.diagnose.search.harmless import Simulations, as_recorded
from firmloop.identify.fitting.experiment import experiments, misfit
from firmloop.identify.fitting.fit import tried
from firmloop.identify.plants.per_recording import ways_to_differ, with_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import constants_of, simulator

Array = NDArray[np.float64]


def differing(made: Simulations, refit: bool = False) -> tuple[tuple[str, ...], float]:
    """Return what the recordings are met nearest by when each has its own, as a project lists it, and what is left.

    That is the rms of the output that gains most over what the same values for all leave. No names where none brings
    simulations of some output far nearer, and of none less near. With `refit` the plant is fitted anew with each: what
    differs from run to run has led the values of one fit for all astray. Without, only what promises as much to the
    first order is simulated: of offsets and gains that is all they do.
    """
    plant, recordings = made.plant, made.recordings
    if len(recordings) < 2 or plant.varying:
        return (), 1.0
    together = np.maximum(made.overall_rms(as_recorded), 1e-300)
    found = {}
    for names in ways_to_differ(plant):
        own = with_varying(plant, names)
        if not refit and np.min(_foretold(own, recordings, made.starts(as_recorded), together) / together) > CLOSER_RMS:
            continue
        anew = tried(own, recordings, NONE) if refit else None
        each = Simulations(own if anew is None else anew.plant, recordings).overall_rms(as_recorded) / together
        if np.all(each <= SAME_RMS) and np.min(each) < CLOSER_RMS:
            found[names] = float(np.min(each))
    # One before many, where many do no more.
    least = min(found, key=lambda names: found[names] * len(names), default=())
    return least, found.get(least, 1.0)


def _foretold(own: Plant, recordings: Sequence[Recording], starts: Sequence[Array | None], sizes: Array) -> Array:
    """Return the rms (r,) that each recording's own values would leave, by slopes where it begins without them.

    `sizes` (r,) weigh the outputs. Infinite where a recording cannot be simulated.
    """
    left = []
    for recording, start in zip(recordings, starts, strict=True):
        if start is None:
            return np.full(len(sizes), np.inf)
        (part,) = experiments(own, recording, NONE)
        begin = np.concatenate([start, np.zeros(len(own.states) - len(start))])
        residual, slopes = misfit(part, simulator(own, recording.hold), constants_of(own), begin, ())
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
            return np.full(len(sizes), np.inf)
        tall = (slopes / sizes[:, None]).reshape(-1, slopes.shape[2])
        step = np.linalg.lstsq(tall, (residual / sizes).ravel(), rcond=1e-9)[0]
        left.append(residual - slopes @ step)
    return np.asarray(np.sqrt(np.mean(np.concatenate(left) ** 2, axis=0)))
