"""Tell which state variables of a float program are never -0, by induction over its operations.

A sum is -0 only where both parts are, a difference only where what is taken from is (IEEE 754, round to nearest): an
integrator that starts at 0 never holds -0, and to add 0 or -0 to it is the same.
"""

from __future__ import annotations

import math

from firmloop.quantize.program import Op, Program


def never_minus_zero(program: Program) -> frozenset[str]:
    """Return the names of the state variables that neither start at -0 nor become -0."""
    writers = {op.result.name: op for op in program.body}
    starts = {value.name: start for value, start in zip(program.state, program.start, strict=True)}
    kept = {name for name, start in starts.items() if not _minus_zero(start) and name != program.unset}
    while True:
        lost = {a.target for a in program.next_state if a.target in kept and not _never(a.source, writers, kept)}
        if not lost:
            return frozenset(kept)
        kept -= lost


def _never(value: str | int | float, writers: dict[str, Op], kept: set[str]) -> bool:
    if not isinstance(value, str):
        return not _minus_zero(value)
    if value.startswith("self."):
        return value.removeprefix("self.") in kept
    op = writers.get(value)
    if op is None:
        return False
    parts = [_never(a, writers, kept) for a in op.arguments]
    match op.function:
        case "add":
            return parts[0] or parts[1]
        case "sub" | "copy":
            return parts[0]
        case "select":
            return parts[1] and parts[2]
        case "clamp" | "min" | "max":
            return all(parts)
    return False


def _minus_zero(value: float) -> bool:
    return value == 0 and math.copysign(1.0, value) < 0
