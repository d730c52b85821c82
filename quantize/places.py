"""Say how many places the products of a sum need, and which of them cost nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from quantize.builder import Term
from quantize.formats import FINEST, fit
from quantize.sums import near_one

WORD = 2**31 - 1
HIGH = 32  # shift of a sum that stands in the upper of two words
NOTHING = Fraction(1, 2**40)  # how far from 1 a weight is 1: a sum in 32 bits would have to run 2^8 times to see it
Part = tuple[Fraction, Term]


def near(value: float | Fraction, fraction: int) -> int:
    """Return the integer that is nearest to a value at a fraction, halves up."""
    return math.floor(Fraction(value) * Fraction(2) ** fraction + Fraction(1, 2))


def split(parts: Sequence[Part], q: int) -> tuple[list[Part], float]:
    """Write weights near 1 as 1 and the rest, where the 1 costs nothing; return what rests left out can amount to.

    A rest of no more than NOTHING is left out: that is what rounding leaves of a coefficient meant to be 1, such as the
    last one of two zeros on the unit circle.
    """
    found: list[Part] = []
    left_out = 0.0
    for weight, term in parts:
        if len(parts) > 1 and near_one(weight) and term.number.fraction == q:
            found.append((Fraction(1), term))
            if abs(weight - 1) > NOTHING:
                found.append((weight - 1, term))
            else:
                left_out += float(abs(weight - 1)) * max(-term.low, term.high) * 2.0**-q
        else:
            found.append((weight, term))
    return found, left_out


def exactly(weight: Fraction, term: Term, q: int) -> bool:
    """Tell whether a product with a weight is a shift to the left, without any rounding."""
    mantissa, exponent = math.frexp(abs(float(weight)))
    shift = q - term.number.fraction + exponent - 1
    return mantissa == 0.5 and 0 <= shift <= 30 and max(-term.low, term.high) * 2**shift <= WORD


def places(part: Part, shift: int, q: int) -> int:
    """Return how many bits the weight has in the format that a sum needs."""
    weight, term = part
    return near(abs(weight), q + shift - term.number.fraction).bit_length()


def bits(part: Part, shift: int, q: int, left: int) -> int:
    """Return the same for a value that is shifted to the left before."""
    return places(part, shift - left, q)


def bits_alone(parts: Sequence[Part], q: int) -> bool:
    """Tell whether each product can be computed by itself with more bits."""
    return all(fit(float(w), float(w), 32) < FINEST and term.number.fraction - q < HIGH for w, term in parts)
