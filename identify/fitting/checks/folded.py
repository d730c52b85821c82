"""A lag or a gain that misses an output which never minds the sign: of the input, or of its own reading.

Where the plant is given the check of signs sees it. A black box without values has nothing to be compared with, and
finds no gain at all: as much goes up with the input as with its opposite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, sources_of
from firmloop.identify.fitting.fit import Fit, tried
from firmloop.identify.fitting.residual_tests import POOR
from firmloop.identify.plants.attach import EffectUse, with_effects
from firmloop.identify.plants.kinds import free_scale
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

_BOTH = 0.1  # of the largest input, on the other side: less hardly tells a sign
_SIGNLESS = 0.03  # of the largest reading: noise of one that has no sign
_ALIKE = 1.2  # times what the better way leaves: so near, the two are one to the recordings
_SIZES: tuple[tuple[str, Callable[[Array], Array]], ...] = (("abs({})", np.abs), ("{}^2", np.square))


def look(evidence: Evidence) -> tuple[str, ...]:
    """Fit the plant to the size of its input, and with a reading that has lost its sign, where it fits poorly."""
    fit, plant = evidence.fit, evidence.given
    assert fit is not None
    if len(plant.inputs) != 1 or len(plant.outputs) != 1 or free_scale(plant) is None or plant.effects:
        return ()
    drive, output = plant.inputs[0].name, plant.outputs[0].name
    if fit.explained >= POOR or not _goes_both_ways(evidence, drive):
        return ()
    sized = {
        name.format(drive): tried(plant, _driven_by(evidence, drive, size), evidence.conditioning)
        for name, size in _SIZES
    }
    known = {name: found for name, found in sized.items() if found is not None}
    best = min(known, key=lambda name: known[name].noise[output], default="")
    folded = _rectified(evidence, known[best].plant) if best else None
    if folded is not None and folded.noise[output] <= _ALIKE * known[best].noise[output]:
        return (_no_sign(evidence, folded),)
    if best and known[best].explained >= POOR:
        return (_no_side(evidence, best, known[best]),)
    return ()


def _goes_both_ways(evidence: Evidence, drive: str) -> bool:
    every = np.concatenate([recording.columns[drive] for recording in evidence.recordings])
    return bool(min(-np.min(every), np.max(every)) > _BOTH * np.max(np.abs(every)))


def _driven_by(evidence: Evidence, drive: str, size: Callable[[Array], Array]) -> tuple[Recording, ...]:
    """Return the recordings with the size of their input in its place."""
    return tuple(
        replace(each, columns=MappingProxyType({**each.columns, drive: size(each.columns[drive])}))
        for each in evidence.recordings
    )


def _rectified(evidence: Evidence, begin: Plant) -> Fit | None:
    """Fit with a reading that has lost its sign, from the plant that the size of the input has led to."""
    output = begin.outputs[0].name
    readings = np.concatenate([recording.columns[output] for recording in evidence.recordings])
    if np.min(readings) < -_SIGNLESS * np.max(readings):
        return None
    wider = with_effects(begin, [EffectUse("sensor_rectified", output, {"share": 1.0}, ())])
    found = tried(wider, evidence.recordings, evidence.conditioning)
    return found if found is not None and found.explained >= POOR else None


def _no_sign(evidence: Evidence, folded: Fit) -> str:
    """Say that the reading has no sign, with what identify may begin at."""
    plant, output = folded.plant, folded.plant.outputs[0].name
    values = ", ".join(f"{p.name} = {{ value = {p.value:.4g}, free = true }}" for p in plant.parameters if p.free)
    return (
        f"{output} of {sources_of(evidence.recordings)} is never negative, though {plant.inputs[0].name} goes both "
        f"ways: a reading without a sign, or an actuator that answers the size alone. As such a reading {plant.kind} "
        f'explains {100.0 * folded.explained:.3g} % of it: write [[plant.effects]] with name = "sensor_rectified", '
        f'output = "{output}" and share = 1, and in [plant.parameters] {values}; or record the direction, too'
    )


def _no_side(evidence: Evidence, size: str, found: Fit) -> str:
    """Say that the plant answers the size of its input."""
    drive, output = evidence.given.inputs[0].name, evidence.given.outputs[0].name
    assert evidence.fit is not None
    before = 100.0 * max(evidence.fit.explained, 0.0)
    return (
        f"{output} of {sources_of(evidence.recordings)} answers the size of {drive}, not its sign: {found.plant.kind} "
        f"explains {100.0 * found.explained:.3g} % of it driven by {size}, and {before:.2g}"
        f" % driven by {drive}; write {size} into a column of its own and name that one in plant.input"
    )


CHECK = Check(
    "folded",
    look,
    ("rest", "drift", "early", "structure", "excitation", "far_from_given"),
    True,
    silenced_by=("clock_unit", "sign", "scale", "three_phases"),
)
