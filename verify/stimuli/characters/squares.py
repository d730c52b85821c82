"""Full-scale squares of every period."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, stack


def squares(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Full-scale squares of periods from two samples to the whole lane, inputs together or against each other."""
    longest = max(1.0, np.log2(length))
    half = np.exp2(random.uniform(0.0, longest - 1.0, size=(lanes, 1))).astype(int)
    up = (np.arange(length) // half) % 2 == 0
    columns = []
    for value in program.inputs:
        low, high = range_of(value)
        turned = random.random((lanes, 1)) < 0.5
        columns.append(np.where(up ^ turned, high, low))
    return stack(program, columns)


STIMULUS = Stimulus("squares", 6, 4, squares, adversarial=True)
