"""Choose golden vectors: short lanes of every character of stimulus, with what the reference answers."""

from __future__ import annotations

import numpy as np

from quantize.program import Program
from verify.reference import Raw, Trace, run
from verify.settings import requests
from verify.stimuli import characters

STEPS = 60  # of a lane: enough to fill the state and to meet limits, few enough to read
LANES = 2  # of each character
SEED = 1


def golden(program: Program) -> tuple[Raw, Raw, Trace]:
    """Return raw inputs (lanes, STEPS, m), what parameters are set to (lanes, STEPS, k), and the reference's run."""
    inputs = np.concatenate([block.inputs for block in characters(program, LANES, STEPS, SEED)])
    settings = requests(program, np.random.default_rng(SEED), *inputs.shape[:2])
    return inputs, settings, run(program, inputs, settings)
