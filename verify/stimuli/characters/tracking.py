"""All inputs move together and apart, by amounts drawn evenly over the decades."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, resolution, stack


def tracking(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """All inputs follow one slow walk across their ranges; each departs from it by a lane's own amplitude."""
    walk = np.cumsum(random.normal(size=(lanes, length)), axis=1)
    walk *= 10.0 ** random.uniform(-3.5, -1.0, size=(lanes, 1))
    place = 0.5 + 0.5 * np.sin(walk + random.uniform(0, 2 * np.pi, size=(lanes, 1)))
    columns = []
    for value in program.inputs:
        low, high = range_of(value)
        smallest = np.log10(resolution(value) / (high - low))
        size = (high - low) * 10.0 ** random.uniform(smallest, 0.0, size=(lanes, 1))
        noise = random.normal(size=(lanes, length))
        drift = np.cumsum(noise, axis=1) / np.sqrt(length)
        away = np.where(random.random((lanes, 1)) < 0.5, noise, drift) * size * 0.3
        columns.append(np.clip(low + (high - low) * place + away, low, high))
    return stack(program, columns)


STIMULUS = Stimulus("tracking", 1, 37, tracking, single_steps=True)
