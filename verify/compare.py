"""Compare a controller behind a link with the reference, step for step, bit for bit. There is no epsilon here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
        for lane in range(block.inputs.shape[0]):
            got = _run_lane(program, link, block, lane, size)
            ticks.append(got["ticks"])
            count, found = differing(program, trace, lane, got)
            differences += count
            if found is not None and first is None:
                step, output, expected, value = found
                first = First(number, lane, step, output, expected, value)
            done += len(got)
            progress(done / total, f"{done:,} of {total:,} steps")
    return Comparison(done, differences, first, np.concatenate(ticks) if ticks else np.zeros(0, np.uint32))


def _run_lane(program: Program, link: Link, block: Block, lane: int, size: int) -> Any:
    link.reset()
    answers = []
    inputs = block.inputs[lane]
    for start in range(0, len(inputs), size):
        part = slice(start, start + size)
        asked = None if block.settings is None else block.settings[lane, part]
        answers.append(link.step(records(program, inputs[part], asked), len(inputs[part])))
    return np.frombuffer(b"".join(answers), dtype=record_type(program))


def differing(program: Program, trace: Trace, lane: int, got: Any) -> tuple[int, tuple[int, str, float, float] | None]:
    """Count differing words in the steps that one lane got; the first comes back as (step, output, expected, got)."""
    count = 0
    first: tuple[int, str, float, float] | None = None
    done = len(got)
    columns = [(v.name, trace.outputs[lane, :done, j], got[f"out_{v.name}"]) for j, v in enumerate(program.outputs)]
    columns.append(("status", trace.status[lane, :done], got["status"]))
    for name, expected, value in columns:
        bits = f"<u{expected.dtype.itemsize}"
        wrong = np.ascontiguousarray(expected).view(bits) != np.ascontiguousarray(value).view(bits)
        if wrong.any():
            count += int(wrong.sum())
            step = int(np.argmax(wrong))
            if first is None or step < first[0]:
                first = (step, name, float(expected[step]), float(value[step]))
    return count, first
