"""Every input anywhere in its range, step by step."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, stack


def noise(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Draw every sample of every input by itself."""
    return stack(program, [random.uniform(*range_of(v), size=(lanes, length)) for v in program.inputs])


STIMULUS = Stimulus("noise", 3, 10, noise, single_steps=True)
