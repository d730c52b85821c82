"""What recordings show without a search: readings in coarse steps; those that wrap around are in wrap.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import COARSE_ANGLE_RAD, COARSE_STEP, EVEN_STEPS, STEPS_ALONE
from firmloop.identify.plants.effects import effect_seen_by, find_effect
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

DIRECT = ("wraps", "steps")  # what is seen without a search, as Effect.seen_by says


@dataclass(frozen=True, slots=True)
class Direct:
    """A sensor's effect that was read off: values and standard deviations in the order of its parameters."""

    effect: str
    output: str
    values: tuple[float, ...]
    deviations: tuple[float, ...]

    @property
    def in_steps(self) -> bool:
        """Whether the sensor reads in steps, the first of its values."""
        return find_effect(self.effect).seen_by == "steps"


def coarse(plant: Plant, train: Sequence[Recording], left: Sequence[float]) -> tuple[Direct, ...]:
    """Return the outputs whose steps are most of what an explanation leaves over; `left` (r,) is its residual rms."""
    found = []
    for signal, rms in zip(plant.outputs, left, strict=True):
        values = np.concatenate([recording.columns[signal.name] for recording in train])
        step = _step(values)
        least = COARSE_ANGLE_RAD if signal.unit == "rad" else COARSE_STEP * float(np.ptp(values))
        if step is not None and step > least and rms < STEPS_ALONE * step:
            found.append(Direct(effect_seen_by("steps").name, signal.name, (step,), (EVEN_STEPS * step,)))
    return tuple(found)


def _step(values: Array) -> float | None:
    """Return the step of which all values are multiples, None where there is none."""
    levels = np.unique(np.round(values, 12))
    if not 1 < len(levels) < len(values):
        return None
    gaps = np.diff(levels)
    step = float(gaps.min())
    step = float(np.mean(gaps[gaps < 1.5 * step]))
    counts = np.round((levels - levels[0]) / step)
    if np.any(np.abs(levels - levels[0] - counts * step) > EVEN_STEPS * step * (20.0 + counts)):
        return None
    return float((levels[-1] - levels[0]) / counts[-1])
