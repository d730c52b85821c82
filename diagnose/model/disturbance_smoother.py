"""See the latent torque and voltage that drive a plant beside its input: a smoother of states and disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.disturbed_plant import tracker
from firmloop.diagnose.policy import MOST_SMOOTHED_ROWS, QUICK_WALK
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import course_of, measured

Array = NDArray[np.float64]

POSITIONS = ("position_rad", "position_m")
SPEEDS = ("speed_rad_s", "speed_m_s")


@dataclass(frozen=True, slots=True)
class Latent:
    """Smoothed states (n, s) of the nominal plant and the disturbance (n,) of each balance that explains the rest.

    `kinds` are those of the balances; a disturbance is in N m, N, V or the flow's unit, positive where it drives.
    """

    time: Array
    states: Array
    disturbances: tuple[Array, ...]
    kinds: tuple[str, ...]


def latent(plant: Plant, recording: Recording, noise: Sequence[float]) -> Latent | None:
    """Smooth the nominal plant with a random-walk disturbance in every balance that the outputs can tell.

    `noise` (r,) is the rms of each output. None where the equations do not allow a smoother, or it diverges.
    """
    balances = [each for each in plant.balances if each.state >= 0][: len(plant.outputs)]
    course = course_of(plant, recording)
    made = tracker(plant, balances, course.step, noise, [QUICK_WALK] * len(balances))
    if made is None:
        return None
    drive = course.drive[:MOST_SMOOTHED_ROWS]
    rows, states = len(drive), len(plant.states)
    outputs = measured(plant, recording)[:rows]
    start = np.zeros(len(made.step))
    start[:states] = np.linalg.lstsq(made.reading[:, :states], outputs[0], rcond=None)[0]
    with np.errstate(over="ignore", invalid="ignore"):  # of bodies that hardly tell them apart it may diverge
        here = made.smoothed(outputs, drive @ made.push.T, start)
    if not np.all(np.isfinite(here)):
        return None
    kinds = tuple(balance.kind for balance in balances)
    disturbances = tuple(here[:, states + k] for k in range(len(balances)))
    return Latent(course.time[:rows], here[:, :states], disturbances, kinds)
