"""Choose the number format by the error that it may make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from design.law import Law
from quantize.lower import lower
from quantize.program import Program, QuantizeError


@dataclass(frozen=True, slots=True)
class Allowed:
    """The most that some outputs may be away from the law in one step; `key` is how the project calls it."""

    key: str
    outputs: tuple[str, ...]
    most: float  # in the outputs' unit


def lower_within(law: Law, arithmetics: Sequence[str], allowed: Sequence[Allowed]) -> Program:
    """Return the first of `arithmetics` whose proven rounding bounds keep every allowance.

    Raises
    ------
    QuantizeError
        when none does, with the bound of each; or when there is one and it is refused.
    """
    reasons = []
    for arithmetic in arithmetics:
        try:
            program = lower(law, arithmetic)
        except QuantizeError as error:
            if len(arithmetics) == 1:
                raise
            reasons.append(f"{arithmetic} is refused ({error})")
            continue
        broken = first_broken(program, allowed)
        if broken is None:
            return program
        reasons.append(f"{arithmetic} {broken}")
    raise QuantizeError(
        f"{allowed[0].key} = {allowed[0].most:g} is not kept: {'; '.join(reasons)}{_way_out(arithmetics)}"
    )


def first_broken(program: Program, allowed: Sequence[Allowed]) -> str | None:
    """Say which output may be farther from the law than allowed; None where none may."""
    for allowance in allowed:
        for rounding in program.rounding:
            if rounding.output in allowance.outputs and not rounding.bound <= allowance.most:
                return f"may put {rounding.output} {rounding.bound:.3g} {rounding.unit} off"
    return None


def _way_out(arithmetics: Sequence[str]) -> str:
    if arithmetics == ("fixed16",):
        return "; leave bits out or write bits = 32"
    return "; allow more, narrow the ranges in [signals], or use a longer number"
