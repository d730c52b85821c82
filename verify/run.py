"""The whole proof for one target, after the trial on this machine: build, link, comparison, explanation, cost."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import Target, load_target
from firmloop.design.law import Law
from firmloop.identify.simulation.compiler import compiler_version
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.quantize.program import Program
from firmloop.verify.block import Block, total_steps
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.host import FLAGS, build_host
from firmloop.verify.build.image import Image, build_image
from firmloop.verify.build.sanitized import SANITIZED_FLAGS
from firmloop.verify.compare import Comparison, compare
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.opener import openers
from firmloop.verify.links.uart import open_port
from firmloop.verify.packing import records
from firmloop.verify.proofs.closed_loop import LoopCheck, PlantLoop, check_loop
from firmloop.verify.reference import Trace
from firmloop.verify.scaling import to_physical
from firmloop.verify.searches import searches
from firmloop.verify.trial import Loaded, Trial, try_out
from firmloop.verify.verdict import NO_COST, ClosedLoop, Cost, Difference, Searches, Verdict, Worst

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

FASTER = 2.0  # times its rated clock, that no board runs
TRIAL_SHARE = 0.5  # of the time, roughly: the rest is the target's


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
    """Try the C on this machine and on `target`: `try_out` and `verify_on`, whose parameters and errors these are."""
    trial = try_out(
        law, program, bundle, recorded, steps, seed, lambda share, doing: progress(TRIAL_SHARE * share, doing)
    )

    def later(share: float, doing: str) -> None:
        progress(TRIAL_SHARE + (1.0 - TRIAL_SHARE) * share, doing)

    return verify_on(trial, target, port, later, loop)


def verify_on(
    trial: Trial, target: Target, port: str | None, progress: Progress, loop: PlantLoop | None = None
) -> Verdict:
    """Build the C for `target`, run it against the bit-exact reference and say whether every bit agreed.

    No target agrees whose C differs on this machine. C in which a sanitizer found something has no one meaning that a
    target could keep: it is not let onto one.

    Parameters
    ----------
    port
        None for the target's usual link, the name of another of its links, or a port of a board that runs already
    loop
        what to close the loop with, on the host and then on the target; a step that is not the same counts as different

    Raises
    ------
    ToolError, LinkError
        when a compiler, the emulator, a port or a board is not there or fails.
    """
    proof = _Proof(trial, target, progress, loop)
    if trial.sanitized.undefined is not None:
        ran = proof.stopped()
    elif "library" in target.links:
        ran = proof.on_host()
    elif port is None or port in openers():
        ran = proof.on_emulator(port or target.links[0])
    else:
        ran = proof.on_port(port)
    looped = ran.looped
    own = ran.comparison.differences + (len(looped.different) if looped else 0)
    if ran.loaded is None:
        here = trial.first(trial.loaded)
        first = (
            trial.explained(ran.comparison.first)
            or _first_in_loop(trial.program, looped)
            or (here and replace(here, lane=f"on this machine, {here.lane}"))
        )
    else:
        own += ran.loaded.apart.differences
        first = trial.first(ran.loaded) or trial.first(trial.loaded)
    return Verdict(
        program_id=trial.program.id,
        target=target.name,
        link=ran.link,
        compiler=ran.compiler,
        flags=ran.flags,
        steps=ran.comparison.steps,
        lanes=sum(b.inputs.shape[0] for b in trial.blocks),
        seed=trial.seed,
        stimuli=_count(trial.blocks),
        saturated=_status_share(trial.traces),
        differences=own or trial.host.differences,
        first=first,
        rounding=trial.rounding,
        cost=ran.cost,
        sanitized=trial.sanitized.steps,
        closed_loop=_closed_loop(looped),
        searches=ran.searches,
        host=trial.host,
        undefined=trial.sanitized.undefined,
        sanitizers_not_run=trial.sanitized.not_run,
    )


@dataclass(frozen=True, slots=True)
class _Ran:
    """What came of one link."""

    comparison: Comparison
    link: str
    compiler: str
    flags: tuple[str, ...]
    cost: Cost = NO_COST
    looped: LoopCheck | None = None
    searches: Searches | None = None
    loaded: Loaded | None = None  # where the link is a library in this process


class _Proof:
    """One trial, ready for any link of a target."""

    def __init__(self, trial: Trial, target: Target, progress: Progress, loop: PlantLoop | None) -> None:
        self.trial, self.target, self.progress, self.loop = trial, target, progress, loop
        self.program, self.blocks, self.traces = trial.program, trial.blocks, trial.traces

    def on_host(self) -> _Ran:
        loaded = self.trial.load(self.target, self.progress)
        flags = (*FLAGS, *self.target.flags)
        return _Ran(loaded.comparison, "library", compiler_version("gcc"), flags, loaded=loaded)

    def stopped(self) -> _Ran:
        loaded = self.trial.loaded
        return _Ran(loaded.comparison, "sanitizers", compiler_version("gcc"), SANITIZED_FLAGS, loaded=loaded)

    def on_emulator(self, name: str) -> _Ran:
        opener = openers()[name]
        files = firmware(self.program, self.trial.bundle, self.target, opener.transport)
        with scratch_folder(Path(tempfile.gettempdir()), "firmloop") as folder:
            image = build_image(files, self.target, folder)
            with opener.open(self.target, image.elf, self.program.id) as link:
                comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
                counts = instructions(comparison.ticks, link.hello().overhead_ticks, self.target)
                cost = self._cost(image, counts, link)
                found = searches(self.program, self.blocks, self.traces, counts)
                looped = self._close_loop(link)
        return _Ran(comparison, name, image.compiler, image.flags, cost, looped, found)

    def on_port(self, port: str) -> _Ran:
        with open_port(self.target, port, self.program.id) as link:
            begin = time.monotonic()
            comparison = compare(self.program, link, self.blocks, self.traces, self.progress)
            taken = time.monotonic() - begin
            cost = self._cycles(comparison, link, taken) if self.target.counts_cycles else NO_COST
            looped = self._close_loop(link)
        return _Ran(comparison, port, "unknown: the image ran already", (), cost, looped)

    def _cost(self, image: Image, counts: NDArray[np.int64], link: FramedLink) -> Cost:
        painted = self._painted(link)
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

    def _cycles(self, comparison: Comparison, link: FramedLink, taken: float) -> Cost:
        """Return what a step costs; nothing where one has more cycles than there were in the `taken` s of all.

        Such a board's counter ran backwards, or it makes its figures up: that is no measurement.
        """
        counts = comparison.ticks.astype(np.int64) - link.hello().overhead_ticks
        painted = self._painted(link)
        cost = replace(NO_COST, stack_bytes=painted, stack_painted_bytes=painted)
        if counts.min() < 0 or counts.max() > FASTER * taken * (self.target.clock_hz or 0):
            return cost
        return replace(
            cost,
            cycles_max=int(counts.max()),
            cycles_mean=round(float(counts.mean()), 2),
            worst=self._worst(int(counts.argmax())),
        )

    def _close_loop(self, link: FramedLink) -> LoopCheck | None:
        if self.loop is None:
            return None
        host = LibraryLink(build_host(self.trial.bundle, load_target("host")), self.program)
        return check_loop(self.program, self.loop, host, link)

    def _painted(self, link: FramedLink) -> int | None:
        """Return the deepest stack that was seen, None where it is more than the image has."""
        block = self.blocks[0]
        asked = None if block.settings is None else block.settings[0]
        depth = link.stack(records(self.program, block.inputs[0], asked))
        return depth if depth <= (self.target.stack_bytes or 0) else None

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
    told, seen, given = (tuple(column.tolist()) for column in (run.reference, run.measurement, run.command))
    return ClosedLoop(len(run.reference), len(looped.different), told, seen, given, looped.says)


def _count(blocks: Sequence[Block]) -> Mapping[str, int]:
    counts: dict[str, int] = {}
    for block in blocks:
        counts[block.name] = counts.get(block.name, 0) + total_steps([block])
    return counts


def _status_share(traces: Sequence[Trace]) -> float:
    set_bits = sum(int(np.count_nonzero(t.status)) for t in traces)
    return round(set_bits / max(1, sum(t.status.size for t in traces)), 4)
