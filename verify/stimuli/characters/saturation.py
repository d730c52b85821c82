"""Inputs held at their ends for most of a lane, so that what integrates winds up."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.stimulus import Stimulus, range_of, stack


def saturation(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """One corner held for most of a lane, then the opposite one, then small noise about the middle."""
    columns = []
    first = int(length * 0.6)
    second = int(length * 0.25)
    for value in program.inputs:
        low, high = range_of(value)
        up = random.random((lanes, 1)) < 0.5
        held = np.broadcast_to(np.where(up, high, low), (lanes, first))
        back = np.broadcast_to(np.where(up, low, high), (lanes, second))
        rest = (low + high) / 2 + (high - low) * 0.001 * random.normal(size=(lanes, length - first - second))
        columns.append(np.concatenate([held, back, np.clip(rest, low, high)], axis=1))
    return stack(program, columns)


STIMULUS = Stimulus("long saturation", 4, 10, saturation, adversarial=True)
