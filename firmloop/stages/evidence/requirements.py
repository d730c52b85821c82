"""A Requirement: what a project asks of its controller, by the key that asks it, and the claims that it rests on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from firmloop.identify.signal import Signal
from firmloop.project.project import Project
from firmloop.quantize.program import Program
from firmloop.stages.evidence.claims import DEFINED, LOOP, MISRA, RANGES, ROUNDING, SAME_BITS, STATED, Claim

MET, OPEN, NOT_MET = "met", "open", "not met"


@dataclass(frozen=True, slots=True)
class Requirement:
    """One requirement; `key` is where the project asks it, or the rule of firmloop that asks it of every project."""

    key: str
    says: str
    claims: tuple[Claim, ...]

    @property
    def status(self) -> str:
        """Not met where one claim does not hold; open where none is decided."""
        if any(claim.holds is False for claim in self.claims):
            return NOT_MET
        return MET if any(claim.holds for claim in self.claims) else OPEN


def requirements(
    project: Project, gains: Mapping[str, float], program: Program, found: Sequence[Claim]
) -> tuple[Requirement, ...]:
    """Return what the project asks, in the order of its file, then what is asked of every project."""

    def resting(about: str, of: str | None = None) -> tuple[Claim, ...]:
        return tuple(claim for claim in found if claim.about == about and of in (None, claim.of))

    def asked() -> Iterator[Requirement]:
        for signal in project.controller_outputs:
            yield Requirement(f"signals.{signal.name}", f"output {_within(signal)}", resting(RANGES))
        for key, says, kept in _limits(project, gains, program):
            yield Requirement(f"controller.{key}", says, resting(RANGES) if kept else ())
        for parameter in program.parameters:
            says = f"parameter {parameter.name} can be set while it runs, and stays within its range"
            yield Requirement(f"controller.tunable.{parameter.name}", says, resting(RANGES))
        for allowed in project.allowed:
            for output in allowed.outputs:
                says = f"one step of {output} is at most {allowed.most:g} off the law"
                yield Requirement(
                    f"{allowed.key}: {output}", says, _allowed(allowed.most, program, resting(ROUNDING, output))
                )
        for claim in resting(SAME_BITS):
            yield Requirement(f"target: {claim.of}", f"runs on {claim.of} as proven", (claim,))
        if resting(LOOP):
            yield Requirement("loop", "the closed loop is stable", resting(LOOP))
        yield Requirement("proof", "the proof is of this very C", resting(STATED))
        yield Requirement("C: defined", "the C does nothing that its standard leaves undefined", resting(DEFINED))
        yield Requirement("C: MISRA", "every departure from MISRA C has its reason", resting(MISRA))

    return tuple(asked())


def _limits(project: Project, gains: Mapping[str, float], program: Program) -> Iterator[tuple[str, str, bool]]:
    """Give each limit of the only output by its key, and whether the range that is proven keeps it.

    A limit is what the output's number format makes of it: 7.3 V in steps of 1/2048 V is 7.2998 V.
    """
    if len(program.outputs) != 1 or len(program.results) != 1:
        return
    (output,), source = project.controller_outputs, program.results[0].source
    held = next((op.result for op in program.body if op.result.name == source), program.outputs[0])
    for key, word, sign, end in (("u_min", "least", -1, held.low), ("u_max", "most", 1, held.high)):
        if key in gains and key not in program.tunable:
            limit = round(math.ldexp(gains[key], held.number.fraction))
            says = f"output {output.name} is at {word} {gains[key]:g} {output.unit}"
            yield key, says, sign * end <= sign * limit


def _allowed(most: float, program: Program, found: Sequence[Claim]) -> tuple[Claim, ...]:
    """Return the claims on an output's rounding; the number format was chosen so that they keep the allowance."""
    assert all(bound.bound <= most for bound in program.rounding for one in found if one.of == bound.output)
    return tuple(found)


def assumptions(project: Project) -> dict[str, str]:
    """Return what the project says of the world, which no judge can decide: the range of every input, the plant."""
    inputs = {f"signals.{one.name}": f"input {_within(one)}" for one in project.controller_inputs}
    kind = {"plant": f"the machine is what [plant] says: {project.plant.kind}"} if project.plant else {}
    return {**inputs, **kind}


def _within(signal: Signal) -> str:
    return f"{signal.name} stays from {signal.low:g} to {signal.high:g} {signal.unit}"
