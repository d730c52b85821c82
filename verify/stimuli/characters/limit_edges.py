"""Short lanes with one sample at the edge of a limit or a rounding."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.edges import edges
from firmloop.verify.stimuli.stimulus import Stimulus

STEPS = 3


def limit_edges(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Return what `edges` finds."""
    return edges(program, random, lanes, length)


STIMULUS = Stimulus("edges of limits", 9, 2, limit_edges, steps=STEPS, short_lanes=False, single_steps=True)
