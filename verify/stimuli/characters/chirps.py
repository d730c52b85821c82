"""Sweeps of the frequency up to half the sample rate."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, stack


def chirps(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Sweeps up to half the sample rate about a random place, of amplitudes over three decades, each in a phase."""
    octaves = np.log2(max(4, length)) - 1
    frequency = np.exp2(octaves * np.arange(length) / length) / max(4, length)  # cycles a sample
    phase = 2 * np.pi * np.cumsum(frequency)
    size = 10.0 ** random.uniform(-3.0, 0.0, size=(lanes, 1))
    place = random.uniform(0.0, 1.0, size=(lanes, 1))
    columns = []
    for value in program.inputs:
        low, high = range_of(value)
        wave = np.sin(phase + random.choice([0.0, np.pi / 2, np.pi], size=(lanes, 1)))
        columns.append(np.clip(low + (high - low) * (place + 0.5 * size * wave), low, high))
    return stack(program, columns)


STIMULUS = Stimulus("chirps", 7, 4, chirps, adversarial=True)
