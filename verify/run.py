"""The whole proof for one target: stimuli, reference, build, link, comparison, explanation, cost."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codegen.bundle import Bundle
from codegen.firmware import firmware
from codegen.target import Target
from design.law import Law
from identify.compiler import compiler_version
from quantize.program import Program
from verify.build import Image, build_image
from verify.compare import Comparison, compare
from verify.cost import instructions
from verify.explain import explain
from verify.host import FLAGS, build_host, run_sanitized, total_steps
from verify.links.framed import FramedLink
from verify.links.library import LibraryLink
from verify.links.semihosting import open_semihosting
from verify.links.uart import open_port, open_qemu_uart
from verify.reference import Trace, run
from verify.rounding import measure_rounding
from verify.stimuli import Block, stimuli
from verify.verdict import NO_COST, Cost, Difference, Verdict

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

OPENERS: Mapping[str, Callable[[Target, Path, str], FramedLink]] = {
    "semihosting": open_semihosting,
    "uart": open_qemu_uart,
}
REFERENCE_SHARE = 0.4  # of the time, roughly: the rest is the target's


def verify(
    law: Law,
    program: Program,
    bundle: Bundle,
    target: Target,
    recorded: Sequence[Mapping[str, Array]],
    steps: int,
    seed: int,
    port: str | None,
    progress: Progress,
) -> Verdict:
    """Build the C for `target`, run it against the bit-exact reference and say whether every bit agreed.

    Parameters
    ----------
    recorded
        physical signals by input name at the controller's period, played beside the generated stimuli
    steps
        generated stimuli, in controller steps
    port
        None for the target's usual link, the name of another of its links, or a port of a board that runs already

    Raises
    ------
    ToolError, LinkError
        when a compiler, the emulator, a port or a board is not there or fails.
    """
    blocks = stimuli(program, recorded, steps, seed)
    traces = []
    for k, block in enumerate(blocks):
        progress(REFERENCE_SHARE * k / len(blocks), f"reference: {block.name}")
        traces.append(run(program, block.inputs))
    proof = _Proof(program, bundle, target, blocks, traces, _later(progress))
    if "library" in target.links:
        comparison, details = proof.on_host()
    elif port is None or port in OPENERS:
        comparison, details = proof.on_emulator(port or target.links[0])
    else:
        comparison, details = proof.on_port(port)
    link, compiler, flags, cost, sanitized = details
    return Verdict(
        program_id=program.id,
        target=target.name,
        link=link,
        compiler=compiler,
        flags=flags,
        steps=comparison.steps,
        lanes=sum(b.inputs.shape[0] for b in blocks),
        seed=seed,
        stimuli=_count(blocks),
        saturated=_status_share(traces),
        differences=comparison.differences,
        first=_first(program, bundle, blocks, comparison),
        rounding=measure_rounding(law, program, blocks, traces),
        cost=cost,
        sanitized=sanitized,
    )


Details = tuple[str, str, tuple[str, ...], Cost, int]  # link, compiler, flags, cost, sanitized steps


class _Proof:
    """One program, its stimuli and what the reference made of them, ready for any link."""

    def __init__(
        self,
        program: Program,
        bundle: Bundle,
        target: Target,
        blocks: Sequence[Block],
        traces: Sequence[Trace],
        progress: Progress,
    ) -> None:
        self.program, self.bundle, self.target = program, bundle, target
        self.blocks, self.traces, self.progress = blocks, traces, progress

    def on_host(self) -> tuple[Comparison, Details]:
        link = LibraryLink(build_host(self.bundle, self.target), self.program)
        comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
        sanitized = 0
        if comparison.differences == 0:
            pairs = zip(self.blocks, self.traces, strict=True)
            sanitized = sum(run_sanitized(self.program, self.bundle, block, trace) for block, trace in pairs)
        flags = (*FLAGS, *self.target.flags)
        return comparison, ("library", compiler_version("gcc"), flags, NO_COST, sanitized)

    def on_emulator(self, transport: str) -> tuple[Comparison, Details]:
        files = firmware(self.program, self.bundle, self.target, transport)
        with tempfile.TemporaryDirectory(prefix="firmloop-") as folder:
            image = build_image(files, self.target, Path(folder))
            with OPENERS[transport](self.target, image.elf, self.program.id) as link:
                comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
                cost = self._cost(image, comparison, link)
        return comparison, (transport, image.compiler, image.flags, cost, 0)

    def on_port(self, port: str) -> tuple[Comparison, Details]:
        with open_port(self.target, port, self.program.id) as link:
            comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
        return comparison, (port, "unknown: the image ran already", (), NO_COST, 0)

    def _cost(self, image: Image, comparison: Comparison, link: FramedLink) -> Cost:
        counts = instructions(comparison.ticks, link.hello().overhead_ticks, self.target)
        first = np.ascontiguousarray(self.blocks[0].inputs[0])
        stack = image.stack_bytes if image.stack_bytes is not None else link.stack(first.tobytes())
        return Cost(
            instructions_max=int(counts.max()),
            instructions_mean=round(float(counts.mean()), 2),
            instructions_min=int(counts.min()),
            text_bytes=image.controller.text_bytes,
            data_bytes=image.controller.data_bytes,
            bss_bytes=image.controller.bss_bytes,
            stack_bytes=stack,
        )


def _first(program: Program, bundle: Bundle, blocks: Sequence[Block], comparison: Comparison) -> Difference | None:
    first = comparison.first
    if first is None:
        return None
    before = total_steps(blocks[: first.block]) + first.lane * blocks[first.block].inputs.shape[1]
    unit = next((v.unit for v in program.outputs if v.name == first.output), "status bits")
    lane = blocks[first.block].inputs[first.lane]
    return Difference(
        step=before + first.step,
        lane=f"{blocks[first.block].name} {first.lane}, step {first.step}",
        output=first.output,
        expected=first.expected,
        got=first.got,
        unit=unit,
        operation=explain(program, bundle, lane, first.step, first.output),
    )


def _later(progress: Progress) -> Progress:
    def shown(fraction: float, label: str) -> None:
        progress(REFERENCE_SHARE + (1.0 - REFERENCE_SHARE) * fraction, label)

    return shown


def _count(blocks: Sequence[Block]) -> Mapping[str, int]:
    counts: dict[str, int] = {}
    for block in blocks:
        counts[block.name] = counts.get(block.name, 0) + total_steps([block])
    return counts


def _status_share(traces: Sequence[Trace]) -> float:
    set_bits = sum(int(np.count_nonzero(t.status)) for t in traces)
    return round(set_bits / max(1, sum(t.status.size for t in traces)), 4)
