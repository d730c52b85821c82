"""Tell where a step never gets to its reference, because the output stands at its limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmloop.design.analysis.loop import Trajectory
from firmloop.design.law import Law
from firmloop.design.roles import reference_and_measurement

THERE = 0.02  # of the step: nearer than that is reached, as for the time of settling


@dataclass(frozen=True, slots=True)
class Unreached:
    """A step of `size` that ends at `end`, both in `unit`: its figures are those of the plant at the limit."""

    size: float
    end: float
    unit: str


def unreached(law: Law, step: Trajectory) -> Unreached | None:
    """Look where the step comes to rest; None where that is the reference, or no limit holds it back."""
    size, end = float(step.reference[-1]), _rest(step)
    at_limit = step.saturated[-1] and step.output[-1] in (step.output.min(), step.output.max())
    if not at_limit or not abs(end) < (1 - THERE) * abs(size):
        return None
    return Unreached(size, end, law.inputs[reference_and_measurement(law.inputs)[0]].unit)


def _rest(step: Trajectory) -> float:
    """Return where a step that slows down like an exponential comes to rest (A. C. Aitken's sum); infinite for a ramp.

    That it is followed for too short a time to rest is no sign of a limit.
    """
    y = step.measurement
    first, second = y[len(y) // 2] - y[0], y[-1] - y[len(y) // 2]
    if not abs(second) < abs(first):
        return math.inf
    return float(y[-1] + second**2 / (first - second))
