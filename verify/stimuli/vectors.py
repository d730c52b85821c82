"""Choose golden vectors: short lanes of every character of stimulus, with what the reference answers."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw, Trace, run
from firmloop.verify.stimuli.settings import requests
from firmloop.verify.stimuli.stimuli import characters

STEPS = 60  # of a lane: enough to fill the state and to meet limits, few enough to read
LANES = 2  # of each character
SEED = 1


def golden(program: Program) -> tuple[Raw, Raw, Trace]:
    """Return raw inputs (lanes, STEPS, m), what parameters are set to (lanes, STEPS, k), and the reference's run."""
    inputs = np.concatenate([block.inputs for block in characters(program, LANES, STEPS, SEED)])
    settings = requests(program, np.random.default_rng(SEED), *inputs.shape[:2])
    return inputs, settings, run(program, inputs, settings)
