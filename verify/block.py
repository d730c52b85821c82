"""A Block: raw inputs of lanes that a controller runs through, each lane afresh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import Raw, Trace, run


@dataclass(frozen=True, slots=True)
class Block:
    """Raw inputs (lanes, steps, m) of one character; `settings` (lanes, steps, k) asks for values of the parameters."""

    name: str
    inputs: Raw
    settings: Raw | None = None  # None where nothing can be tuned, or nothing is


def run_blocks(
    program: Program, blocks: Sequence[Block], progress: Callable[[float, str], None] = lambda share, doing: None
) -> list[Trace]:
    """Run `program` on every block; the blocks of one length side by side, which takes hardly longer than one."""
    traces: dict[int, Trace] = {}
    groups = by_length(blocks)
    for k, group in enumerate(groups):
        progress(k / len(groups), "reference: " + ", ".join(dict.fromkeys(blocks[i].name for i in group)))
        whole = side_by_side([blocks[i] for i in group])
        trace = run(program, whole.inputs, whole.settings)
        at = 0
        for i in group:
            end = at + len(blocks[i].inputs)
            traces[i] = Trace(trace.outputs[at:end], trace.status[at:end], trace.state[at:end])
            at = end
    return [traces[i] for i in range(len(blocks))]


def by_length(blocks: Sequence[Block]) -> list[list[int]]:
    """Return the places of the blocks of one length, together."""
    groups: dict[int, list[int]] = {}
    for i, block in enumerate(blocks):
        groups.setdefault(block.inputs.shape[1], []).append(i)
    return list(groups.values())


def side_by_side(blocks: Sequence[Block]) -> Block:
    """Return one block with the lanes of all these, which have one length."""
    if len(blocks) == 1:
        return blocks[0]
    asked = [block.settings for block in blocks if block.settings is not None]
    assert len(asked) in (0, len(blocks)), "all blocks set parameters, or none does"
    inputs = np.concatenate([block.inputs for block in blocks])
    return Block(blocks[0].name, inputs, np.concatenate(asked) if asked else None)


def total_steps(blocks: Sequence[Block]) -> int:
    """Return the number of steps in all blocks."""
    return sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks)
