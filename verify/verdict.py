"""A Verdict: what was compared, on what, and whether every bit agreed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from firmloop.verify.compare import First
from firmloop.verify.judgement import Judgement

EQUATIONS = "the plant"  # what a loop is closed against where nothing stands in the place of its equations


@dataclass(frozen=True, slots=True)
class Function:
    """One function of the controller: bytes of its code, and of the stack of it and all it calls (None: not known)."""

    name: str
    text_bytes: int
    stack_bytes: int | None


@dataclass(frozen=True, slots=True)
class Undefined:
    """What a sanitizer stopped: its words, the line of the controller's C that it stopped in, and the step."""

    says: str
    file: str
    line: int
    operation: str
    at: First

    def sentence(self) -> str:
        """Say it in one line."""
        where = f"{self.file}:{self.line}: " if self.line else ""
        return f"undefined behavior: {where}{self.says}" + (f", in: {self.operation}" if self.operation else "")


@dataclass(frozen=True, slots=True)
class Difference:
    """The first step at which an output or the status word differs; values as the C holds them, and in `unit`."""

    step: int
    lane: str
    output: str
    expected: float
    got: float
    unit: str
    operation: str


@dataclass(frozen=True, slots=True)
class Rounded:
    """How far the program stood from the law: worst |program - law| of one output in one step, and its proven bound."""

    output: str
    worst: float
    bound: float
    unit: str
    drift: float  # worst |program - law| where the law ran on its own state through whole lanes


@dataclass(frozen=True, slots=True)
class Worst:
    """The step that took longest: which, and what it read, in the units of the inputs."""

    step: int
    lane: str
    inputs: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Cost:
    """What one step costs; None where it was not measured."""

    instructions_max: float | None
    instructions_mean: float | None
    instructions_min: float | None
    text_bytes: int | None
    data_bytes: int | None
    bss_bytes: int | None
    stack_bytes: int | None
    stack_painted_bytes: int | None = None  # what the steps really wrote; stack_bytes is the compiler's sum where known
    cycles_max: int | None = None  # of a real processor; an emulator knows none
    cycles_mean: float | None = None
    worst: Worst | None = None
    functions: tuple[Function, ...] = ()


NO_COST = Cost(None, None, None, None, None, None, None)


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """The controller on the target against the plant in this process; arrays one value a step, physical units."""

    steps: int
    differences: int  # steps at which it was not the run with the controller on the host, bit for bit
    reference: Sequence[float]
    measurement: Sequence[float]
    command: Sequence[float]
    against: str = EQUATIONS  # or what stood in the place of its equations

    def as_dict(self) -> dict[str, object]:
        """Return what verdict.json tells of it."""
        told: dict[str, object] = {"steps": self.steps, "differences": self.differences}
        return told if self.against == EQUATIONS else told | {"against": self.against}


@dataclass(frozen=True, slots=True)
class Searches:
    """What the searches of a predictive controller did around the step that took longest, and what bounds them.

    `side` has a row a step and a place a limit: -1 where the low one is active, 1 the high one, else 0. `work` and
    `budget` are counted as `quantize/twins/qp.py` says; `capped` and `infeasible` are steps of the whole run,
    `within` are those of both that read nothing beyond its range. No search takes more work than its budget, by
    construction; `instructions_bound` takes it at the most that a unit of work was seen to take.
    """

    begins: int  # step of the run that the first row is of
    side: Sequence[Sequence[int]]
    work: Sequence[int]
    instructions: Sequence[int]
    budget: int
    work_max: int
    instructions_bound: int  # of one step, with the whole budget taken
    capped: int
    infeasible: int
    within: int


@dataclass(frozen=True, slots=True)
class HostRun:
    """What this machine made of the same C over the same stimuli, whichever target the verdict is about."""

    steps: int
    differences: int
    any_state_steps: int  # single steps from drawn states, compared besides


@dataclass(frozen=True, slots=True)
class Verdict:
    """One target's comparison against the bit-exact reference, and what this machine found in the same C."""

    program_id: str
    target: str
    link: str
    compiler: str
    flags: tuple[str, ...]
    steps: int
    lanes: int
    seed: int
    stimuli: Mapping[str, int]  # steps of each kind
    saturated: float  # share of the steps with a status bit set
    differences: int  # on the target; where it has none, those of this machine
    first: Difference | None
    rounding: tuple[Rounded, ...]
    cost: Cost
    sanitized: int  # steps repeated on this machine under the undefined-behavior and address sanitizers
    closed_loop: ClosedLoop | None = None  # not run without a plant, nor on the host, which it is compared with
    searches: Searches | None = None  # where instructions are counted, of a controller that searches
    host: HostRun | None = None
    undefined: Undefined | None = None  # what a sanitizer found
    proofs: tuple[Judgement, ...] = ()  # what each judge said of every input and state, not only of those tried
    sanitizers_not_run: str = ""  # why not all of these steps ran, where a sanitizer or time was missing

    @property
    def agrees(self) -> bool:
        """Whether every output and status word of every step was the same."""
        return self.differences == 0

    def as_dict(self) -> dict[str, object]:
        """Return verdict.json."""
        first = self.first
        return {
            "schema": 1,
            "program_id": self.program_id,
            "target": self.target,
            "link": self.link,
            "compiler": self.compiler,
            "flags": list(self.flags),
            "steps": self.steps,
            "lanes": self.lanes,
            "seed": self.seed,
            "stimuli": dict(self.stimuli),
            "status_share": self.saturated,
            "sanitized_steps": self.sanitized,
            "sanitizers_not_run": self.sanitizers_not_run or None,
            "undefined_behavior": None
            if self.undefined is None
            else {
                "says": self.undefined.sentence(),
                "file": self.undefined.file or None,
                "line": self.undefined.line or None,
                "operation": self.undefined.operation or None,
            },
            "host": None
            if self.host is None
            else {
                "steps": self.host.steps,
                "differences": self.host.differences,
                "any_state_steps": self.host.any_state_steps,
            },
            "differences": self.differences,
            "first_difference": None
            if first is None
            else {
                "step": first.step,
                "lane": first.lane,
                "output": first.output,
                "expected": _finite(first.expected),
                "got": _finite(first.got),
                "unit": first.unit,
                "operation": first.operation,
            },
            "rounding": {
                r.output: {
                    "worst": _finite(r.worst),
                    "bound": _finite(r.bound),
                    "unit": r.unit,
                    "free_running_worst": _finite(r.drift),
                }
                for r in self.rounding
            },
            "cost": {
                "instructions_max": self.cost.instructions_max,
                "instructions_mean": self.cost.instructions_mean,
                "instructions_min": self.cost.instructions_min,
                "cycles_max": self.cost.cycles_max,
                "cycles_mean": self.cost.cycles_mean,
                "text_bytes": self.cost.text_bytes,
                "data_bytes": self.cost.data_bytes,
                "bss_bytes": self.cost.bss_bytes,
                "stack_bytes": self.cost.stack_bytes,
                "stack_painted_bytes": self.cost.stack_painted_bytes,
            },
            "worst_step": None
            if self.cost.worst is None
            else {
                "step": self.cost.worst.step,
                "lane": self.cost.worst.lane,
                "inputs": {name: _finite(value) for name, value in self.cost.worst.inputs.items()},
            },
            "closed_loop": None if self.closed_loop is None else self.closed_loop.as_dict(),
            "search": None
            if self.searches is None
            else {
                "budget": self.searches.budget,
                "work_max": self.searches.work_max,
                "instructions_bound": self.searches.instructions_bound,
                "capped_steps": self.searches.capped,
                "infeasible_steps": self.searches.infeasible,
                "within_ranges_steps": self.searches.within,
            },
            "proofs": [judgement.as_dict() for judgement in self.proofs],
            "verdict": "agrees" if self.agrees else "differs",
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
