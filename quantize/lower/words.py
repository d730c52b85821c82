"""Put numbers on the grids of fixed-point words, drop places that have no room, and tell by how much that is off."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from firmloop.quantize.lower.builder import Operand, Term
from firmloop.quantize.lower.places import WORD, near
from firmloop.quantize.program import Number


@dataclass(frozen=True, slots=True)
class Dropping:
    """The operations that drop places, and by how many units in the last place they are wrong at most."""

    end: str  # of a sum of products
    product: str
    shift: str
    error: float
    adds: bool  # whether a product can be rounded so as it is added


ROUNDINGS = {
    "nearest": Dropping("high", "mul_shift", "shr", 0.5, True),
    "floor": Dropping("high_down", "mul_down", "asr", 1.0, False),
}


def number(q: int) -> Number:
    """Return the format of a word with `q` fractional places."""
    return Number("fixed", 32, q)


def operand(operand: Operand, fraction: int, toward: Callable[[float, int], int]) -> tuple[Term | int, float]:
    """Return an operand at `fraction` and its error; limits of outputs stand on the output's own grid."""
    if isinstance(operand, Term):
        assert operand.number.fraction == fraction, "values that meet share a format"
        return operand, operand.error
    if operand.grid is not None and operand.grid < fraction and toward is not near:
        raw = toward(operand.value, operand.grid) << (fraction - operand.grid)
    else:
        raw = toward(operand.value, fraction)
    raw = min(max(raw, -WORD - 1), WORD)
    return raw, literal_error(operand.value, raw, fraction)


def ends(a: Term | int) -> tuple[float, float]:
    """Return the lowest and the highest value of an operand, raw."""
    return (a.low, a.high) if isinstance(a, Term) else (a, a)


def literal_error(value: float | Fraction, raw: int, fraction: int) -> float:
    """Return by how much a raw number is off a value."""
    return abs(float(Fraction(value) - Fraction(raw) / Fraction(2) ** fraction))


def down(value: float, fraction: int) -> int:
    """Return the next raw number below a value."""
    return math.floor(Fraction(value) * Fraction(2) ** fraction)


def up(value: float, fraction: int) -> int:
    """Return the next raw number above a value."""
    return math.ceil(Fraction(value) * Fraction(2) ** fraction)
