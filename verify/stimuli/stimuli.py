"""Inputs that make a controller show its differences: corners, noise, tracking, worst cases, recorded signals.

Everything is drawn from one seed. A lane is one controller started afresh. Wide noise keeps most controllers at their
limits, where a wrong gain cannot be seen; so a part of the lanes moves all inputs together and apart by amounts drawn
evenly over the decades, down to one unit in the last place. What a linear law can be driven to is reached by one input
only, the reversed sign of its impulse response (see `design/linear/reach.py`); that input is among them for every
output and state, beside full-scale squares and chirps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program
from firmloop.verify.block import Block
from firmloop.verify.reference import Raw
from firmloop.verify.stimuli.characters import every_stimulus
from firmloop.verify.stimuli.characters.fresh_starts import STEPS as FRESH_STEPS
from firmloop.verify.stimuli.characters.tracking import tracking
from firmloop.verify.stimuli.settings import requests
from firmloop.verify.stimuli.stimulus import LANE_STEPS, range_of, stack

Array = NDArray[np.float64]
RECORDED_STEPS = 2500  # of a lane cut from a recording: many lanes run at once, one long one does not


def stimuli(program: Program, recorded: Sequence[Mapping[str, Array]], steps: int, seed: int) -> list[Block]:
    """Return blocks that hold `steps` steps, and what fits of the recorded signals on top.

    Parameters
    ----------
    recorded
        physical signals by input name, one sample a controller period; an input that is missing follows a step.
    """
    random = np.random.default_rng(seed)
    length = min(LANE_STEPS, max(1, steps))
    blocks: list[Block] = []
    whole = sum(stimulus.weight for stimulus in every_stimulus())
    for stimulus in every_stimulus():
        if sum(len(block.inputs) * block.inputs.shape[1] for block in blocks) >= steps:
            break
        span = min(stimulus.steps, length)
        count = max(1, round(stimulus.weight / whole * steps / span))
        blocks.append(Block(stimulus.name, stimulus.make(program, random, count, span)))
    blocks = _cut(blocks, max(1, steps))
    blocks += _rest(program, random, max(1, steps) - sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks))
    for signals in recorded:
        blocks += _lanes(_recorded(program, signals, random))
    if program.tunable:
        return [Block(b.name, b.inputs, requests(program, random, *b.inputs.shape[:2])) for b in blocks]
    return blocks


def characters(program: Program, lanes: int, steps: int, seed: int) -> list[Block]:
    """Return lanes of `steps` steps, so many of each character that short lanes show."""
    random = np.random.default_rng(seed)
    shown = [stimulus for stimulus in every_stimulus() if stimulus.short_lanes]
    return [Block(stimulus.name, stimulus.make(program, random, lanes, steps)) for stimulus in shown]


def singles(program: Program, steps: int, seed: int) -> list[Block]:
    """Return `steps` lanes of one step each, in equal shares of what needs no more."""
    random = np.random.default_rng(seed)
    enough = [stimulus for stimulus in every_stimulus() if stimulus.single_steps]
    share = max(1, steps // len(enough))
    return [Block(stimulus.name, stimulus.make(program, random, share, 1)) for stimulus in enough]


def adversarial(program: Program, steps: int, seed: int) -> list[Block]:
    """Return about `steps` steps of what brings values and roundings to their ends, in equal shares.

    The worst cases are as long as the steps allow: a slow state needs many samples to reach its end.
    """
    random = np.random.default_rng(seed)
    hard = [stimulus for stimulus in every_stimulus() if stimulus.adversarial]
    share = steps // len(hard)
    ends = 2 * (len(program.outputs) + len(program.state))
    blocks = []
    for stimulus in hard:
        length = max(stimulus.steps, min(stimulus.longest, share // ends))
        made = stimulus.make(program, random, max(1, round(share / length)), length)
        blocks.append(Block(stimulus.name, made))
    if program.tunable:
        return [Block(b.name, b.inputs, requests(program, random, *b.inputs.shape[:2])) for b in blocks]
    return blocks


def _lanes(inputs: Raw) -> list[Block]:
    """Cut one long recorded lane (1, steps, m) into lanes of at most RECORDED_STEPS and a rest."""
    _, steps, width = inputs.shape
    whole = steps // RECORDED_STEPS
    cut = inputs[:, : whole * RECORDED_STEPS].reshape(whole, RECORDED_STEPS, width)
    rest = inputs[:, whole * RECORDED_STEPS :]
    return [Block("recorded", part) for part in (cut, rest) if part.size]


def _cut(blocks: list[Block], steps: int) -> list[Block]:
    """Keep at most `steps` steps in all; the last lane kept may be a short one."""
    kept, left = [], steps
    for block in blocks:
        lanes, length, _ = block.inputs.shape
        whole = min(lanes, left // length)
        if whole:
            kept.append(Block(block.name, block.inputs[:whole]))
            left -= whole * length
        if whole < lanes and 0 < left < length:
            kept.append(Block(block.name, block.inputs[whole : whole + 1, :left]))
            left = 0
    return kept


def _rest(program: Program, random: np.random.Generator, steps: int) -> list[Block]:
    """Return tracking lanes of `steps` steps in all: what shares that are rounded, or not wanted whole, leave.

    They are as long as other lanes, which they then run beside (see `run_blocks`).
    """
    blocks = []
    for length in (LANE_STEPS, FRESH_STEPS, 1):
        lanes, steps = divmod(steps, length)
        if lanes:
            blocks.append(Block("tracking", tracking(program, random, lanes, length)))
    return blocks


def _recorded(program: Program, signals: Mapping[str, Array], random: np.random.Generator) -> Raw:
    length = min((len(s) for s in signals.values()), default=0)
    columns = []
    for value in program.inputs:
        low, high = range_of(value)
        if value.name in signals:
            columns.append(np.clip(np.asarray(signals[value.name], dtype=np.float64)[None, :length], low, high))
            continue
        others = [np.asarray(s, dtype=np.float64)[:length] for s in signals.values()]
        middle = float(np.mean(others[0])) if others and length else 0.0
        spread = float(np.std(others[0])) if others and length else 0.0
        held = np.repeat(random.choice([-1.0, 0.0, 1.0], size=length // 200 + 1), 200)[:length]
        columns.append(np.clip(middle + spread * held, low, high)[None, :])
    return stack(program, columns)
