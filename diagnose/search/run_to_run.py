"""Ask what differs from run to run that a plant takes to be the same: a load, the zero or the gain of a sensor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from firmloop.diagnose.policy import CLOSER_RMS, SAME_RMS
from firmloop.diagnose.search.harmless import overall_rms
from firmloop.identify.fitting.own_values import placed_start
from firmloop.identify.plants.per_recording import ways_to_differ, with_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording


def differing(plant: Plant, recordings: Sequence[Recording]) -> tuple[tuple[str, ...], float]:
    """Return what the recordings are met nearest by when each has its own, as a project lists it, and what is left.

    That is the rms of the output that gains most over what the same values for all leave. No names where none brings
    simulations of some output far nearer, and of none less near.
    """
    if len(recordings) < 2 or plant.varying:
        return (), 1.0
    together = overall_rms(plant, recordings, placed_start)
    ratios = {
        names: overall_rms(with_varying(plant, names), recordings, placed_start) / np.maximum(together, 1e-300)
        for names in ways_to_differ(plant)
    }
    found = {
        names: float(np.min(each))
        for names, each in ratios.items()
        if np.all(each <= SAME_RMS) and np.min(each) < CLOSER_RMS
    }
    # One before many, where many do no more.
    least = min(found, key=lambda names: found[names] * len(names), default=())
    return least, found.get(least, 1.0)
