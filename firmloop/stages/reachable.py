"""Tell references that the actuator cannot hold the plant at, by the plant's gain at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from firmloop.design.roles import reference_and_measurement
from firmloop.identify.plants.operating_point import INPUT, OUTPUT
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import Linear

ROOM = 0.1  # of what can be held: a range may be as much wider, for overshoot and for what the plant is off


@dataclass(frozen=True, slots=True)
class Beyond:
    """`reference` asks for more than `low` to `high` (its unit), where `output` at its ends holds the plant."""

    reference: Signal
    output: Signal
    low: float
    high: float


def beyond_reach(
    inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], plant: Plant, linear: Linear
) -> Beyond | None:
    """Compare the reference's range with the plant at rest at either end of the output's; None where it can follow.

    None also where nothing can be told: an integrator goes anywhere, and an unstable plant rests nowhere.
    """
    a = np.atleast_2d(linear.a)
    if linear.b.shape[1] != 1 or len(outputs) != 1 or np.any(np.linalg.eigvals(a).real >= 0.0):
        return None
    gain = float(linear.d[0, 0] - (linear.c[0] @ np.linalg.solve(a, linear.b[:, 0]) if len(a) else 0.0))
    levels = {parameter.name: parameter.value for parameter in plant.parameters}
    reference, output = inputs[reference_and_measurement(inputs)[0]], outputs[0]
    ends = (levels.get(OUTPUT, 0.0) + gain * (end - levels.get(INPUT, 0.0)) for end in (output.low, output.high))
    low, high = sorted(ends)
    room = ROOM * (high - low)
    if not np.isfinite(room) or (reference.low >= low - room and reference.high <= high + room):
        return None
    return Beyond(reference, output, low, high)
