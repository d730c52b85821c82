"""Lower sine, cosine, square root and reciprocal to fixed point, with what the twins are off.

Each is computed at the fraction its twin gives, and brought to the one that the law's graph asks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Protocol

from firmloop.quantize.lower.builder import Builder, Term
from firmloop.quantize.lower.words import Dropping
from firmloop.quantize.program import TOO_FAR, Number, QuantizeError
from firmloop.quantize.twins.curved import (
    INVERSE_ROUNDING,
    ROOT_ERROR,
    SINE_ERROR,
    SINE_PLACES,
    inverse_error,
)

HALF_WORD = 16  # bits of what the reciprocal divides by


class Emitter(Protocol):
    """What the lowering of one value needs of a builder."""

    ops: Builder
    rounding: Dropping

    def widened(self, a: Term, q: int) -> Term:
        """Return a value at fraction `q`."""
        ...


def wave(function: str, emitter: Emitter, angle: Term, q: int) -> Term:
    """Return the sine or cosine of an angle in rad."""
    wish, emitter.ops.wish = emitter.ops.wish, ("", "")
    per_turn = Fraction(2.0 / math.pi) * 2**30 / Fraction(2) ** angle.number.fraction  # of one raw unit
    s = min(32, 30 - math.floor(math.log2(per_turn)))
    if s < 1:
        raise QuantizeError(f"an angle has a unit of {2.0**-angle.number.fraction:g} rad: {TOO_FAR}")
    factor = round(per_turn * 2**s)
    away = abs(float(factor / (per_turn * 2**s)) - 1.0) + 2.0**-52
    error = angle.error + max(-angle.low, angle.high) * 2.0**-angle.number.fraction * away + 2 * math.pi * 2.0**-32
    share = emitter.ops.emit("turn", (angle, factor, s), Number("fixed", 32, 32), error)
    emitter.ops.wish = wish
    found = emitter.ops.emit(function, (share,), Number("fixed", 32, SINE_PLACES), min(error + SINE_ERROR, 2.0))
    return emitter.widened(found, q)


def rotated(emitter: Emitter, products: Sequence[tuple[float, Term, Term]], q: int) -> Term | None:
    """Return the sum of weight times wave times value, rounded once; None where that takes more than one shift."""
    wish, emitter.ops.wish = emitter.ops.wish, ("", "")
    coarse = min(value.number.fraction for _, _, value in products)
    values = [emitter.widened(value, coarse) for _, _, value in products]
    share, power = math.frexp(abs(products[0][0]))  # 0.5 where the weight is a power of two
    shift = SINE_PLACES + coarse - q - (power - 1)
    alike = all(abs(weight) == abs(products[0][0]) for weight, _, _ in products) and share == 0.5
    fits = alike and 1 <= shift <= 62 and all(wave.number.fraction == SINE_PLACES for _, wave, _ in products)
    total: Term | None = None
    error = emitter.rounding.error * 2.0**-q
    for (weight, wave, _), value in zip(products if fits else (), values, strict=fits):
        size = max(-value.low, value.high) * 2.0**-coarse
        error += abs(weight) * (value.error * (1.0 + wave.error) + size * wave.error)
        turned = wave if weight > 0 else emitter.ops.emit("neg", (wave,), wave.number, wave.error)
        start = () if total is None else (total,)
        wide = Number("fixed", 64, SINE_PLACES + coarse)
        total = emitter.ops.emit("wide" if total is None else "mac", (*start, turned, value), wide, 0.0)
    emitter.ops.wish = wish
    return (
        None if total is None else emitter.ops.emit(emitter.rounding.end, (total, shift), Number("fixed", 32, q), error)
    )


def root(emitter: Emitter, a: Term, q: int) -> Term:
    """Return the square root of a value that is not negative."""
    if a.low < 0:
        raise QuantizeError("it takes the root of a value that may be below 0; limit that to 0 and more in the law")
    wish, emitter.ops.wish = emitter.ops.wish, ("", "")
    own = q
    while 2 * own - a.number.fraction < 1:
        own += 1
    a = a if (2 * own - a.number.fraction) % 2 else emitter.widened(a, a.number.fraction - 1)
    size, low = a.high * 2.0**-a.number.fraction, a.low * 2.0**-a.number.fraction - a.error
    # Near 0 the root is steeper than any line: what is e apart there is the root of e apart.
    brought = min(math.sqrt(a.error), a.error / (2.0 * math.sqrt(low)) if low > 0.0 else math.inf)
    error = brought + ROOT_ERROR * math.sqrt(size) + 2.0**-own
    emitter.ops.wish = wish
    found = emitter.ops.emit("whole_root", (a, 2 * own - a.number.fraction), Number("fixed", 32, own), error)
    return emitter.widened(found, q)


def reciprocal(emitter: Emitter, b: Term, q: int) -> Term:
    """Return 1 over a value above 0."""
    k = max(0, int(b.high).bit_length() - HALF_WORD)
    if int(b.low) >> k < 8:
        raise QuantizeError(
            f"the reciprocal of a value from {b.low * 2.0**-b.number.fraction:g} to "
            f"{b.high * 2.0**-b.number.fraction:g} is not right to four digits in fixed point: narrow that range"
        )
    j = q - 31 - k + b.number.fraction
    wish, emitter.ops.wish = emitter.ops.wish, ("", "")
    own = max(j, 0)
    least = b.low * 2.0**-b.number.fraction
    number = Number("fixed", 32, q - j + own)
    error = b.error / (least * (least - b.error)) if b.error < least else math.inf
    error += inverse_error((int(b.low), int(b.high)), k) / least + INVERSE_ROUNDING * 2.0**-number.fraction
    emitter.ops.wish = wish
    return emitter.widened(emitter.ops.emit("inverse", (b, k, own), number, error), q)


CURVES: Mapping[str, Callable[[Emitter, Term, int], Term]] = {
    "sin": lambda emitter, a, q: wave("turn_sine", emitter, a, q),
    "cos": lambda emitter, a, q: wave("turn_cosine", emitter, a, q),
    "sqrt": root,
    "div": reciprocal,
}
