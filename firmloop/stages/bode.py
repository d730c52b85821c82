"""Follow the open loop over frequency, and say how far it may be off within the plant's intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.design.analysis.loop import loop_response
from firmloop.design.analysis.uncertainty import half_widths
from firmloop.design.law import Law
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import Linear, linearize

POINTS = 160
BELOW = 100.0  # of the crossover: where the picture begins
SPAN = 1e4  # from the first frequency to the last where there is no crossover
END = 0.999  # of the Nyquist frequency, where a zero of the loop may stand
LEAST = 1e-30  # of a gain, whose logarithm is drawn

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bode:
    """L(exp(j w h)) at the frequencies, arrays (n,); half widths of 95 % intervals, None where the plant has none."""

    frequency: Array  # rad/s
    gain: Array  # dB
    phase: Array  # deg
    gain_half: Array | None
    phase_half: Array | None


def bode(law: Law, plant: Plant, crossover: float) -> Bode:
    """Measure the loop broken at the plant's first input, from below its crossover (rad/s) to the Nyquist frequency."""
    last = END * math.pi / law.period
    first = crossover / BELOW if math.isfinite(crossover) and 0.0 < crossover < last else last / SPAN
    frequency = np.geomspace(first, last, POINTS)

    def figures(moved: Linear) -> Mapping[str, float]:
        gain, phase = _drawn(law, moved, frequency)
        return _named("gain", gain) | _named("phase", phase)

    gain, phase = _drawn(law, linearize(plant), frequency)
    halves = half_widths(plant, figures)
    return Bode(frequency, gain, phase, _unnamed("gain", halves, POINTS), _unnamed("phase", halves, POINTS))


def _drawn(law: Law, linear: Linear, frequency: Array) -> tuple[Array, Array]:
    response = loop_response(law, linear, frequency)
    gain = 20.0 * np.log10(np.maximum(np.abs(response), LEAST))
    return gain, np.degrees(np.unwrap(np.angle(response)))


def _named(name: str, values: Array) -> dict[str, float]:
    return {f"{name} {k}": float(value) for k, value in enumerate(values)}


def _unnamed(name: str, halves: Mapping[str, float], count: int) -> Array | None:
    found = [halves.get(f"{name} {k}", math.inf) for k in range(count)]
    return np.array(found) if halves else None
