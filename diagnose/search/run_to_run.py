"""Ask what differs from run to run that a plant takes to be the same: a load, the zero or the gain of a sensor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from firmloop.diagnose.policy import CLOSER_RMS, SAME_RMS
from firmloop.diagnose.search.harmless import as_recorded, overall_rms
from firmloop.identify.fitting.fit import tried
from firmloop.identify.plants.per_recording import ways_to_differ, with_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording


def differing(plant: Plant, recordings: Sequence[Recording], refit: bool = False) -> tuple[tuple[str, ...], float]:
    """Return what the recordings are met nearest by when each has its own, as a project lists it, and what is left.

    That is the rms of the output that gains most over what the same values for all leave. No names where none brings
    simulations of some output far nearer, and of none less near. With `refit` the plant is fitted anew with each: what
    differs from run to run has led the values of one fit for all astray.
    """
    if len(recordings) < 2 or plant.varying:
        return (), 1.0
    together = np.maximum(overall_rms(plant, recordings, as_recorded), 1e-300)
    found = {}
    for names in ways_to_differ(plant):
        own = with_varying(plant, names)
        anew = tried(own, recordings, NONE) if refit else None
        made = own if anew is None else anew.plant
        each = overall_rms(made, recordings, as_recorded) / together
        if np.all(each <= SAME_RMS) and np.min(each) < CLOSER_RMS:
            found[names] = float(np.min(each))
    # One before many, where many do no more.
    least = min(found, key=lambda names: found[names] * len(names), default=())
    return least, found.get(least, 1.0)
