"""All inputs move together and apart, by amounts drawn evenly over the decades."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, resolution, stack


def tracking(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """All inputs follow one slow walk across their ranges; each departs from it by a lane's own amplitude."""
    place = random.normal(size=(lanes, length))  # computed in place: new memory would take longer than the numbers
    np.cumsum(place, axis=1, out=place)
    place *= 10.0 ** random.uniform(-3.5, -1.0, size=(lanes, 1))
    place += random.uniform(0, 2 * np.pi, size=(lanes, 1))
    np.sin(place, out=place)
    place *= 0.5
    place += 0.5
    columns = []
    for value in program.inputs:
        low, high = range_of(value)
        smallest = np.log10(resolution(value) / (high - low))
        size = (high - low) * 10.0 ** random.uniform(smallest, 0.0, size=(lanes, 1))
        away = random.normal(size=(lanes, length))
        drifts = random.random(lanes) >= 0.5
        away[drifts] = np.cumsum(away[drifts], axis=1) / np.sqrt(length)
        away *= size
        away *= 0.3
        away += low + (high - low) * place
        columns.append(np.clip(away, low, high, out=away))
    return stack(program, columns)


STIMULUS = Stimulus("tracking", 1, 37, tracking, single_steps=True)
