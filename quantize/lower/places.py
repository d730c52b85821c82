"""Say how many places the products of a sum need, which cost nothing, and which are nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from firmloop.quantize.lower.builder import Term
from firmloop.quantize.lower.q_formats import FINEST, fit
from firmloop.quantize.lower.sums import near_one
from firmloop.quantize.program import TOO_FAR, QuantizeError

WORD = 2**31 - 1
HIGH = 32  # shift of a sum that stands in the upper of two words
FEWEST_BITS = 20  # of a coefficient: a gain is then right to 5e-7
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


def vanishes(term: Term, q: int) -> bool:
    """Tell whether a value, though not 0, always rounds to 0 at fraction `q`; so does each that is 32 places finer."""
    half = 2.0 ** (term.number.fraction - q - 1)
    return half >= 1 and -term.low <= half and term.high < half and not term.low == term.high == 0


def nothing(most: float, q: int) -> QuantizeError:
    """Return the refusal of a value of that size where the law needs it at fraction `q`."""
    return QuantizeError(
        f"a value of at most {most:.3g} is nothing in units of {2.0**-q:.3g}, the finest in which what it is added to, "
        "compared with or stored as fits its word: narrow the wide ranges in [signals], raise the gain or range that "
        "makes this value, or use float32"
    )


def places(part: Part, shift: int, q: int) -> int:
    """Return how many bits the weight has in the format that a sum needs."""
    weight, term = part
    return near(abs(weight), q + shift - term.number.fraction).bit_length()


def shifts(products: Sequence[Part], q: int) -> tuple[int, list[int]]:
    """Return by how much a sum is shifted at its end, and each value to the left before it is multiplied."""
    room = [max(0, math.floor(math.log2(WORD / max(1, -term.low - 1, term.high)))) for _, term in products]
    needed = [places(p, HIGH, q) - 31 for p in products]
    if all(n <= r for n, r in zip(needed, room, strict=True)):
        return HIGH, [max(0, n) for n in needed]
    shift = min(HIGH - max(needed), 62)
    if shift < 1:
        raise QuantizeError(f"a product cannot be brought to Q{q}: {TOO_FAR}")
    return shift, [0] * len(products)


def apart(products: Sequence[Part], others: Sequence[Part], constant: Fraction, q: int) -> bool:
    """Tell whether a sum fits its word at each of its parts, and no product is nothing by itself."""
    parts = [abs(float(weight)) * size(term, 0) * 2.0**q + 1 for weight, term in (*products, *others)]
    return min(parts[: len(products)]) > 2 and sum(parts) + abs(float(constant)) * 2.0**q <= WORD


def bits(part: Part, shift: int, q: int, left: int) -> int:
    """Return the same for a value that is shifted to the left before."""
    return places(part, shift - left, q)


def bits_alone(parts: Sequence[Part], q: int) -> bool:
    """Tell whether each product can be computed by itself with more bits."""
    return all(fit(float(w), float(w), 32) < FINEST and term.number.fraction - q < HIGH for w, term in parts)


def coefficient(value: float, from_q: int, to_q: int) -> tuple[int, int]:
    """Return (shift, raw) of a constant that takes a value from one format to another in `mul_shift`.

    The shift is 32 where the constant then has 20 to 31 bits; its rounding is at most a quarter of the result's last
    place there, whatever its size.
    """
    natural = fit(value, value, 32)  # fraction at which the constant fills 31 bits
    shift = from_q + natural - to_q
    bits_lost = shift - 32
    if 0 <= bits_lost <= 31 - FEWEST_BITS:
        shift = 32
    shift = min(shift, 62)
    raw = near(value, to_q + shift - from_q)
    if raw == 0 or shift < 0 or natural >= FINEST:
        raise QuantizeError(
            f"the coefficient {value:g} cannot be held in fixed point beside the ranges it works on: it is too "
            f"{'large' if shift < 0 else 'small'}; rescale the signals' units or use float32"
        )
    return shift, raw


def size(a: Term | int, q: int) -> float:
    """Return the largest magnitude of a value, or of a raw number at fraction `q`."""
    if isinstance(a, Term):
        return max(abs(a.low), abs(a.high)) * 2.0**-a.number.fraction
    return abs(a) * 2.0**-q


def seen(found: Sequence[Term], products: Sequence[Part], beside: int, q: int) -> Sequence[Term]:
    """Return products as they are, unless all came out as nothing and only one value stands beside them."""
    most = sum(abs(float(weight)) * size(term, 0) for weight, term in products)
    if beside == 1 and most and all(term.low == term.high == 0 for term in found):
        raise nothing(most, q)
    return found
