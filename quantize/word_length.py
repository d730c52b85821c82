"""Choose the number format by the error that it may make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program, QuantizeError

SHARE = 0.1  # of an output's range; a controller that is farther off is none


@dataclass(frozen=True, slots=True)
class Allowed:
    """The most that some outputs may be away from the law in one step; `key` is how the project calls it."""

    key: str
    outputs: tuple[str, ...]
    most: float  # in the outputs' unit


def lower_within(law: Law, arithmetics: Sequence[str], allowed: Sequence[Allowed], rounds: str = "nearest") -> Program:
    """Return the first of `arithmetics` whose proven rounding bounds keep every allowance.

    Raises
    ------
    QuantizeError
        when none does, with the bound of each; or when there is one and it is refused.
    """
    reasons = []
    for arithmetic in arithmetics:
        try:
            program = lower(law, arithmetic, rounds)
        except QuantizeError as error:
            if len(arithmetics) == 1:
                raise
            reasons.append(f"{arithmetic} is refused ({error})")
            continue
        broken = _useless(law, program) or first_broken(program, allowed)
        if broken is None:
            return program
        reasons.append(f"{arithmetic} {broken}")
    asked = f"{allowed[0].key} = {allowed[0].most:g} is not kept: " if allowed else ""
    raise QuantizeError(f"{asked}{'; '.join(reasons)}{_way_out(arithmetics, allowed)}")


def _useless(law: Law, program: Program) -> str | None:
    """Say which output may be wrong by a large part of its range: its gain leaves no digits for it.

    The bound of a law that solves says nothing about its digits: how a solution is rounded is not followed. Nor does
    that of a state without a bound, such as an integral that nothing stops: its digits are those of what it holds.
    """
    if law.solve is not None or any(not math.isfinite(s.high - s.low) for s in law.state):
        return None
    for signal, rounding in zip(law.outputs, program.rounding, strict=True):
        if rounding.bound > SHARE * (signal.high - signal.low) and math.isfinite(rounding.bound):
            return f"may put {rounding.output} {rounding.bound:.3g} {rounding.unit} off, more than a tenth of its range"
    return None


def first_broken(program: Program, allowed: Sequence[Allowed]) -> str | None:
    """Say which output may be farther from the law than allowed; None where none may."""
    for allowance in allowed:
        for rounding in program.rounding:
            if rounding.output in allowance.outputs and not rounding.bound <= allowance.most:
                return f"may put {rounding.output} {rounding.bound:.3g} {rounding.unit} off"
    return None


def _way_out(arithmetics: Sequence[str], allowed: Sequence[Allowed]) -> str:
    if arithmetics == ("fixed16",):
        return "; leave bits out or write bits = 32"
    more = "allow more" if allowed else "lower the gains"
    return f"; {more}, narrow the ranges in [signals], or use a longer number"
