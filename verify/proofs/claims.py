"""What a proof.json claims of a program, as every judge reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

LEAST = -(1 << 31)  # what a fixed-point state that is not set yet holds
PLANS = ("solve", "sweeps", "tree", "improve", "rows")  # their result is a plan, or sums, read by:
OF_A_PLAN = ("move", "capped", "infeasible", "row")
Number = int | float
Argument = str | int | float


class ProofError(Exception):
    """A claim that is not proven; the message names it and gives values that break it, or the rule it breaks."""


@dataclass(frozen=True, slots=True)
class Held:
    """A named value and the range claimed for it; an end is None where floating point claims nothing."""

    name: str
    kind: str  # "fixed" or "float"
    bits: int
    fraction: int
    low: Number | None
    high: Number | None


@dataclass(frozen=True, slots=True)
class ClaimedOperation:
    """`result = function(arguments)`."""

    result: Held
    function: str
    arguments: tuple[Argument, ...]

    def says(self) -> str:
        """Return it as one writes it."""
        return f"{self.result.name} = {self.function}({', '.join(map(str, self.arguments))})"


@dataclass(frozen=True, slots=True)
class Routine:
    """A part of the program that an operation calls; its results are given by name."""

    name: str
    inputs: tuple[str, ...]
    operations: tuple[ClaimedOperation, ...]
    results: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Claims:
    """Everything that a proof.json says of a program."""

    name: str
    program_id: str
    arithmetic: str
    period: float  # s
    inputs: tuple[Held, ...]
    outputs: tuple[Held, ...]
    results: tuple[str, ...]  # one name for each output
    state: tuple[Held, ...]
    start: tuple[Number | None, ...]  # one for each state; None is no number
    following: Mapping[str, str]  # state: what it becomes
    unset: str | None
    parameters: tuple[tuple[str, Number, Number, Number], ...]  # name, low, high, start
    operations: tuple[ClaimedOperation, ...]
    tables: tuple[Mapping[str, Any], ...]
    routines: tuple[Routine, ...]
    status: tuple[tuple[str, int, str], ...]  # name, bit, value
    any_state: Mapping[str, tuple[int, int]]  # operation: its range while states hold anything, where that is larger
    safe: tuple[Number, ...]  # each output where the last status bit holds; none in fixed point

    @property
    def fixed(self) -> bool:
        """Whether ranges are claims on words."""
        return self.arithmetic.startswith("fixed")

    def keeps(self, parameter: str) -> bool:
        """Tell whether a step leaves a parameter as its setter has left it: the same, or limited to its range."""
        source = self.following[parameter]
        if source == f"self.{parameter}":
            return True
        low, high = next((low, high) for name, low, high, _ in self.parameters if name == parameter)
        return any(
            op.result.name == source and (op.function, op.arguments) == ("clamp", (f"self.{parameter}", low, high))
            for op in self.operations
        )

    def from_any_state(self) -> Claims:
        """Return what is claimed of one step, in fixed point, while every state word holds anything."""
        return replace(
            self,
            state=tuple(replace(value, low=LEAST, high=-LEAST - 1) for value in self.state),
            operations=tuple(self._loose(op) for op in self.operations),
        )

    def _loose(self, op: ClaimedOperation) -> ClaimedOperation:
        low, high = self.any_state.get(op.result.name, (op.result.low, op.result.high))
        return replace(op, result=replace(op.result, low=low, high=high))
