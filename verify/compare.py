"""Compare a controller behind a link with the reference, step for step, bit for bit. There is no epsilon here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.program import Program
from firmloop.verify.block import Block
from firmloop.verify.link import Link
from firmloop.verify.packing import records
from firmloop.verify.reference import Trace, element_type

Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class First:
    """Where the first difference stands: block and lane number, step in the lane, output (or "status"), both values."""

    block: int
    lane: int
    step: int
    output: str
    expected: float
    got: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """`ticks` holds the target's clock ticks of every step, in order."""

    steps: int
    differences: int
    first: First | None
    ticks: NDArray[np.uint32]


def record_type(program: Program) -> np.dtype[Any]:
    """Return the layout of one step's answer: the packed outputs, the status word, the tick count."""
    fields = [(f"out_{v.name}", element_type(v.number)) for v in program.outputs]
    return np.dtype([*fields, ("status", "<u4"), ("ticks", "<u4")])


def compare(
    program: Program, link: Link, blocks: Sequence[Block], traces: Sequence[Trace], progress: Progress
) -> Comparison:
    """Run every lane of every block on the link, afresh, and count the values that differ in any bit."""
    size = link.hello().steps_max
    total = sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks)
    done, differences = 0, 0
    first: First | None = None
    ticks: list[NDArray[np.uint32]] = []
    for number, (block, trace) in enumerate(zip(blocks, traces, strict=True)):
        lanes, steps, _ = block.inputs.shape
        at_once = max(1, size // steps)
        for lane in range(0, lanes, at_once):
            part = slice(lane, min(lane + at_once, lanes))
            asked = None if block.settings is None else block.settings[part]
            many = part.stop - lane
            answers = link.lanes(records(program, block.inputs[part], asked), many, steps)
            got = np.frombuffer(answers, dtype=record_type(program)).reshape(many, steps)
            ticks.append(got["ticks"].ravel())
            count, found = differing(program, trace, lane, got)
            differences += count
            if found is not None and first is None:
                first = replace(found, block=number)
            done += got.size
            progress(done / total, f"{done:,} of {total:,} steps")
    return Comparison(done, differences, first, np.concatenate(ticks) if ticks else np.zeros(0, np.uint32))


def differing(program: Program, trace: Trace, lane: int, got: Any) -> tuple[int, First | None]:
    """Count differing words in the records (lanes, steps) that lanes got, from `lane` on, and find the first of them.

    The first is that of the earliest lane, there of the earliest step; its block is the caller's to say.
    """
    lanes, done = got.shape
    part = slice(lane, lane + lanes)
    columns = [(v.name, trace.outputs[part, :done, j], got[f"out_{v.name}"]) for j, v in enumerate(program.outputs)]
    columns.append(("status", trace.status[part, :done], got["status"]))
    count = 0
    firsts: list[tuple[int, int, First]] = []
    for name, expected, value in columns:
        bits = f"<u{expected.dtype.itemsize}"
        wrong = expected.view(bits) != value.view(bits)
        found = int(np.count_nonzero(wrong))
        if found:
            count += found
            at, step = divmod(int(np.argmax(wrong)), done)
            first = First(0, lane + at, step, name, float(expected[at, step]), float(value[at, step]))
            firsts.append((at * done + step, len(firsts), first))
    return count, min(firsts)[2] if firsts else None
