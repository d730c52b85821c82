"""The whole proof for one target: stimuli, reference, build, link, comparison, explanation, cost."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codegen.bundle import Bundle
from codegen.firmware import firmware
from codegen.target import Target, load_target
from design.law import Law
from identify.compiler import compiler_version
from quantize.program import Program
from verify.any_state import Departures, any_state, departures
from verify.build import Image, build_image
from verify.closed_loop import LoopCheck, PlantLoop, check_loop
from verify.compare import Comparison, compare
from verify.cost import instructions
from verify.explain import explain
from verify.host import FLAGS, build_host, run_sanitized, total_steps
from verify.links.framed import FramedLink
from verify.links.library import LibraryLink
from verify.links.opener import openers
from verify.links.uart import open_port
from verify.reference import Trace
from verify.rounding import measure_rounding
from verify.search import searches
from verify.settings import records
from verify.stimuli import Block, run_blocks, stimuli, to_physical
from verify.verdict import NO_COST, ClosedLoop, Cost, Difference, Searches, Verdict, Worst

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

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
    loop: PlantLoop | None = None,
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
    loop
        what to close the loop with, on the host and then on the target; a step that is not the same counts as different

    On the host steps from any state are compared besides (`verify/any_state.py`); what differs there counts as well.

    Raises
    ------
    ToolError, LinkError
        when a compiler, the emulator, a port or a board is not there or fails.
    """
    blocks = stimuli(program, recorded, steps, seed)
    traces = run_blocks(program, blocks, lambda share, doing: progress(REFERENCE_SHARE * share, doing))
    proof = _Proof(program, bundle, target, blocks, traces, _later(progress), loop, (seed, steps // 10))
    if "library" in target.links:
        comparison, details = proof.on_host()
    elif port is None or port in openers():
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
        differences=comparison.differences
        + proof.apart.differences
        + (len(proof.looped.different) if proof.looped else 0),
        first=_first(program, bundle, blocks, comparison) or proof.apart.first or _first_in_loop(program, proof.looped),
        rounding=measure_rounding(law, program, blocks, traces),
        cost=cost,
        sanitized=sanitized,
        closed_loop=_closed_loop(proof.looped),
        searches=proof.searches,
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
        loop: PlantLoop | None,
        drawn: tuple[int, int],
    ) -> None:
        self.program, self.bundle, self.target, self.loop, self.drawn = program, bundle, target, loop, drawn
        self.apart = Departures(0, 0, None)
        self.looped: LoopCheck | None = None
        self.searches: Searches | None = None
        self.blocks, self.traces, self.progress = blocks, traces, progress

    def on_host(self) -> tuple[Comparison, Details]:
        link = LibraryLink(build_host(self.bundle, self.target), self.program)
        comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
        self.apart = departures(self.program, link, any_state(self.program, *self.drawn))
        sanitized = 0
        if comparison.differences == 0:
            pairs = zip(self.blocks, self.traces, strict=True)
            sanitized = sum(run_sanitized(self.program, self.bundle, block, trace) for block, trace in pairs)
        flags = (*FLAGS, *self.target.flags)
        return comparison, ("library", compiler_version("gcc"), flags, NO_COST, sanitized)

    def on_emulator(self, name: str) -> tuple[Comparison, Details]:
        opener = openers()[name]
        files = firmware(self.program, self.bundle, self.target, opener.transport)
        with tempfile.TemporaryDirectory(prefix="firmloop-") as folder:
            image = build_image(files, self.target, Path(folder))
            with opener.open(self.target, image.elf, self.program.id) as link:
                comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
                cost = self._cost(image, comparison, link)
                self._close_loop(link)
        return comparison, (name, image.compiler, image.flags, cost, 0)

    def on_port(self, port: str) -> tuple[Comparison, Details]:
        with open_port(self.target, port, self.program.id) as link:
            comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
            cost = self._cycles(comparison, link) if self.target.counts_cycles else NO_COST
            self._close_loop(link)
        return comparison, (port, "unknown: the image ran already", (), cost, 0)

    def _cost(self, image: Image, comparison: Comparison, link: FramedLink) -> Cost:
        counts = instructions(comparison.ticks, link.hello().overhead_ticks, self.target)
        painted = self._painted(link)
        self.searches = searches(self.program, self.blocks, self.traces, counts)
        return Cost(
            instructions_max=int(counts.max()),
            instructions_mean=round(float(counts.mean()), 2),
            instructions_min=int(counts.min()),
            text_bytes=image.controller.text_bytes,
            data_bytes=image.controller.data_bytes,
            bss_bytes=image.controller.bss_bytes,
            stack_bytes=image.stack_bytes if image.stack_bytes is not None else painted,
            stack_painted_bytes=painted,
            worst=self._worst(int(counts.argmax())),
            functions=image.functions,
        )

    def _cycles(self, comparison: Comparison, link: FramedLink) -> Cost:
        counts = comparison.ticks.astype(np.int64) - link.hello().overhead_ticks
        painted = self._painted(link)
        return replace(
            NO_COST,
            stack_bytes=painted,
            stack_painted_bytes=painted,
            cycles_max=int(counts.max()),
            cycles_mean=round(float(counts.mean()), 2),
            worst=self._worst(int(counts.argmax())),
        )

    def _close_loop(self, link: FramedLink) -> None:
        if self.loop is not None:
            host = LibraryLink(build_host(self.bundle, load_target("host")), self.program)
            self.looped = check_loop(self.program, self.loop, host, link)

    def _painted(self, link: FramedLink) -> int:
        block = self.blocks[0]
        asked = None if block.settings is None else block.settings[0]
        return link.stack(records(self.program, block.inputs[0], asked))

    def _worst(self, step: int) -> Worst:
        """Return what the step read; `step` counts through all lanes of all blocks."""
        left = step
        for block in self.blocks:
            lanes, length, _ = block.inputs.shape
            if left < lanes * length:
                lane, at = divmod(left, length)
                read = block.inputs[lane, at]
                values = {v.name: float(to_physical(v, x)) for v, x in zip(self.program.inputs, read, strict=True)}
                if block.settings is not None:
                    asked = block.settings[lane, at]
                    pairs = zip(self.program.parameters, asked, strict=True)
                    values |= {v.name: float(to_physical(v, x)) for v, x in pairs}
                return Worst(step, f"{block.name} {lane}, step {at}", values)
            left -= lanes * length
        raise AssertionError("a step of no block")


def _first(program: Program, bundle: Bundle, blocks: Sequence[Block], comparison: Comparison) -> Difference | None:
    first = comparison.first
    if first is None:
        return None
    before = total_steps(blocks[: first.block]) + first.lane * blocks[first.block].inputs.shape[1]
    unit = next((v.unit for v in program.outputs if v.name == first.output), "status bits")
    block = blocks[first.block]
    lane, asked = block.inputs[first.lane], None if block.settings is None else block.settings[first.lane]
    return Difference(
        step=before + first.step,
        lane=f"{blocks[first.block].name} {first.lane}, step {first.step}",
        output=first.output,
        expected=first.expected,
        got=first.got,
        unit=unit,
        operation=explain(program, bundle, lane, first.step, first.output, asked),
    )


def _first_in_loop(program: Program, looped: LoopCheck | None) -> Difference | None:
    if looped is None or not looped.different:
        return None
    step, output = looped.different[0], program.outputs[0]
    return Difference(
        step=step,
        lane=f"closed loop, step {step}",
        output=output.name,
        expected=float(looped.expected.command[step]),
        got=float(looped.run.command[step]),
        unit=output.unit,
        operation="in the closed loop with the plant",
    )


def _closed_loop(looped: LoopCheck | None) -> ClosedLoop | None:
    if looped is None:
        return None
    run = looped.run
    columns = [tuple(column.tolist()) for column in (run.reference, run.measurement, run.command)]
    return ClosedLoop(len(run.reference), len(looped.different), *columns)


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
