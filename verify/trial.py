"""Try a program's C on this machine before any target: under the sanitizers, and as a library."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.target import Target, load_target
from firmloop.design.law import Law
from firmloop.quantize.program import Program
from firmloop.verify.block import Block, run_blocks, total_steps
from firmloop.verify.build.host import build_host
from firmloop.verify.build.sanitized import Sanitized, compare_sanitized, run_sanitized
from firmloop.verify.compare import Comparison, First, compare
from firmloop.verify.explain import explain
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.any_state import Departures, any_state, departures
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import Trace
from firmloop.verify.stimuli.stimuli import stimuli
from firmloop.verify.verdict import Difference, HostRun, Rounded

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

REFERENCE_SHARE = 0.8  # of the time, roughly: the rest is this machine's


@dataclass(frozen=True, slots=True)
class Loaded:
    """What the C did as a library in this process: over the stimuli, and in single steps from any state."""

    comparison: Comparison
    apart: Departures

    @property
    def differences(self) -> int:
        """Count what differs in either."""
        return self.comparison.differences + self.apart.differences


@dataclass(frozen=True, slots=True)
class Trial:
    """One program, what it was fed, what the reference made of it, and what its C made of it on this machine."""

    program: Program
    bundle: Bundle
    blocks: Sequence[Block]
    traces: Sequence[Trace]
    seed: int
    any_state_steps: int  # asked for
    rounding: tuple[Rounded, ...]
    sanitized: Sanitized
    loaded: Loaded

    def load(self, target: Target, progress: Progress) -> Loaded:
        """Return what the library does that `target`, whose flags may be others, builds for this machine."""
        if target.flags == load_target("host").flags:
            return self.loaded
        return _load(self, target, progress)

    @property
    def host(self) -> HostRun:
        """Return the figures; where a sanitizer stopped the program, as far as it came."""
        differences = self.loaded.differences or self.sanitized.differences
        return HostRun(self.loaded.comparison.steps, differences, self.loaded.apart.steps)

    def first(self, loaded: Loaded) -> Difference | None:
        """Return the first difference on this machine: what was stopped, else over the stimuli, else from a state."""
        found = self.sanitized.undefined
        if found is not None:
            return self.difference(found.at, found.sentence())
        return self.explained(loaded.comparison.first) or loaded.apart.first or self.explained(self.sanitized.first)

    def explained(self, first: First | None) -> Difference | None:
        """Say at which operation of the C a difference arises."""
        if first is None:
            return None
        block = self.blocks[first.block]
        asked = None if block.settings is None else block.settings[first.lane]
        operation = explain(self.program, self.bundle, block.inputs[first.lane], first.step, first.output, asked)
        return self.difference(first, operation)

    def difference(self, first: First, operation: str) -> Difference:
        """Say where in the whole run a difference stands."""
        before = total_steps(self.blocks[: first.block]) + first.lane * self.blocks[first.block].inputs.shape[1]
        return Difference(
            step=before + first.step,
            lane=f"{self.blocks[first.block].name} {first.lane}, step {first.step}",
            output=first.output,
            expected=first.expected,
            got=first.got,
            unit=next((v.unit for v in self.program.outputs if v.name == first.output), "status bits"),
            operation=operation,
        )


def try_out(
    law: Law,
    program: Program,
    bundle: Bundle,
    recorded: Sequence[Mapping[str, Array]],
    steps: int,
    seed: int,
    progress: Progress,
) -> Trial:
    """Run the reference, then the same C on this machine: under the sanitizers, and as a library.

    Parameters
    ----------
    recorded
        physical signals by input name at the controller's period, played beside the generated stimuli
    steps
        generated stimuli, in controller steps

    Raises
    ------
    ToolError
        when this machine has no compiler, or it refuses the code.
    """
    blocks = stimuli(program, recorded, steps, seed)
    with ThreadPoolExecutor(max_workers=1) as beside:  # two programs of their own, the compiler and what it builds
        running = beside.submit(run_sanitized, program, bundle, blocks)
        traces = run_blocks(program, blocks, lambda share, doing: progress(REFERENCE_SHARE * share, doing))
        rounding = measure_rounding(law, program, blocks, traces)
        progress(REFERENCE_SHARE, "under the sanitizers")
        sanitized = compare_sanitized(program, bundle, running.result(), traces)
    nothing = Loaded(Comparison(0, 0, None, np.zeros(0, np.uint32)), Departures(0, 0, None))
    # Code in which a sanitizer found something is not let into this process, where it could end it.
    trial = Trial(program, bundle, blocks, traces, seed, steps // 10, rounding, sanitized, nothing)
    return replace(trial, loaded=_stopped(sanitized) or _load(trial, load_target("host"), progress))


def _stopped(sanitized: Sanitized) -> Loaded | None:
    """Return what is known of a program that a sanitizer stopped: the step that did not end counts as different."""
    if sanitized.undefined is None:
        return None
    done = sanitized.steps + 1
    comparison = Comparison(done, sanitized.differences + 1, sanitized.undefined.at, np.zeros(done, np.uint32))
    return Loaded(comparison, Departures(0, 0, None))


def _load(trial: Trial, target: Target, progress: Progress) -> Loaded:
    program = trial.program
    link = LibraryLink(build_host(trial.bundle, target), program)

    def shown(share: float, doing: str) -> None:
        progress(REFERENCE_SHARE + (1.0 - REFERENCE_SHARE) * share, doing)

    comparison = compare(program, link, trial.blocks, trial.traces, shown)
    return Loaded(comparison, departures(program, link, any_state(program, trial.seed, trial.any_state_steps)))
