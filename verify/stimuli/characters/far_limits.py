"""Lanes that reach the edge of a limit only after many samples."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw
from firmloop.verify.scaling import to_physical
from firmloop.verify.stimuli.approach import approaches
from firmloop.verify.stimuli.characters.noise import noise
from firmloop.verify.stimuli.characters.squares import squares
from firmloop.verify.stimuli.characters.worst_case import worst
from firmloop.verify.stimuli.stimulus import Array, Stimulus

SEARCHED = 16  # lanes of each character in which limits are sought that are crossed late,
LATEST = 400  # and how late


def afar(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Bring values to limits that they reach after many samples; noise where none does.

    A program that solves takes long to try, and is left out.
    """
    if not program.solves and program.state:
        samples = lanes * length
        latest = min(length, LATEST, max(1, samples // 3))
        hard = [make(program, random, SEARCHED, latest) for make in (worst, squares)]
        drives = np.concatenate([_physical(program, drive) for drive in hard])
        found = approaches(program, random, drives, samples)
        if found is not None:
            return found
    return noise(program, random, lanes, length)


def _physical(program: Program, inputs: Raw) -> Array:
    return np.stack([to_physical(v, inputs[..., j]) for j, v in enumerate(program.inputs)], axis=-1)


STIMULUS = Stimulus("limits from afar", 10, 4, afar, short_lanes=False)
