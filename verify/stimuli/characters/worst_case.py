"""The inputs that drive one output or state to the bound of its response."""

from __future__ import annotations

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw, run
from firmloop.verify.scaling import to_physical
from firmloop.verify.stimuli.stimulus import Array, Stimulus, range_of, stack

LONGEST = 40_000  # steps of a lane where there is room: a slow state needs many samples to reach its end
LONGEST_PLANNED = 100  # samples of the response of a program that follows a plant's equations: each takes long


def worst(program: Program, random: np.random.Generator, lanes: int, length: int) -> Raw:
    """Drive each output and state in turn to the L1 bound of its response, up and down, at the lane's end.

    Half of the lanes stay off the ends of the ranges by up to a thousandth, so that no two samples round alike.
    """
    answered = min(length, LONGEST_PLANNED) if program.routines else length
    signs = np.sign(_impulse_responses(program, answered))[:, ::-1]
    signs = np.pad(signs, ((0, 0), (length - answered, 0), (0, 0)))
    signs = np.where(signs == 0, 1.0, signs)  # (targets, length, m)
    targets = np.arange(lanes) // 2 % len(signs)
    drive = signs[targets] * np.where(np.arange(lanes) % 2, -1.0, 1.0)[:, None, None]
    off = np.where(np.arange(lanes) // (2 * len(signs)) % 2, 1e-3, 0.0)[:, None]
    columns = []
    for j, value in enumerate(program.inputs):
        low, high = range_of(value)
        away = off * (high - low) * random.random((lanes, length))
        columns.append(np.where(drive[..., j] > 0, high - away, low + away))
    return stack(program, columns)


def _impulse_responses(program: Program, length: int) -> Array:
    """Return (targets, length, m): how outputs and states answer a short pulse at each input, from its middle."""
    middle = np.array([sum(range_of(v)) / 2 for v in program.inputs])
    pulse = np.array([(v_range[1] - v_range[0]) / 8 for v_range in map(range_of, program.inputs)])
    drive = np.broadcast_to(middle, (len(middle) + 1, length + 1, len(middle))).copy()
    drive[np.arange(1, len(middle) + 1), 1, np.arange(len(middle))] += pulse  # a first sample may be special
    trace = run(program, stack(program, list(np.moveaxis(drive, -1, 0))))
    columns = [to_physical(v, trace.outputs[..., j]) for j, v in enumerate(program.outputs)]
    columns += [to_physical(v, trace.state[..., j]) for j, v in enumerate(program.state)]
    answers = np.array([column[1:] - column[0] for column in columns])[:, :, 1:]  # (targets, m, length)
    return np.moveaxis(np.nan_to_num(answers), 1, 2)


STIMULUS = Stimulus("worst case", 5, 4, worst, adversarial=True, longest=LONGEST)
