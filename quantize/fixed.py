"""Emit a law's integer operations in the formats chosen for them, with bounds proven as they go.

All values are computed in 32-bit words; a product is taken in 64 bits and rounded back. With 16-bit arithmetic the
inputs and outputs are 16-bit words and are shifted to and from the 32-bit values. No operation can overflow: each
one's bound follows from its operands' bounds, and where the law lets a value grow (state, outputs) the value
saturates at its declared or proven range.

A product by a constant is brought into its format by the constant: where it fits, the shift is 32, which many cores
have as one instruction. `error` follows the worst case of every rounding: half a unit in the last place for each
product and right shift, |x| times the coefficient's own rounding for each constant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

from quantize.builder import Builder, Constant, Operand, Term
from quantize.formats import FINEST, fit
from quantize.program import Number, QuantizeError

WORD = 2**31 - 1
FEWEST_BITS = 20  # of a coefficient: a gain is then right to 5e-7


def _down(value: float, fraction: int) -> int:
    return math.floor(Fraction(value) * Fraction(2) ** fraction)


def _up(value: float, fraction: int) -> int:
    return math.ceil(Fraction(value) * Fraction(2) ** fraction)


def _near(value: float, fraction: int) -> int:
    return math.floor(Fraction(value) * Fraction(2) ** fraction + Fraction(1, 2))


@dataclass(slots=True)
class FixedBuilder:
    """Emits integer operations; `word` is the width of inputs and outputs, 16 or 32.

    The last argument of each operation, `q`, is the fraction of its result.
    """

    word: int
    ops: Builder = field(default_factory=Builder)

    def signal(self, low: float, high: float, q: int) -> Number:
        """Return the format of an input or output: `q` in a 32-bit word, the finest that fits in a 16-bit one."""
        return Number("fixed", self.word, q if self.word == 32 else min(fit(low, high, 16), q))

    def literal(self, value: float, number: Number) -> int:
        """Return the raw value nearest to a physical one."""
        return _near(value, number.fraction)

    def limits(self, low: float, high: float, number: Number) -> tuple[int, int]:
        """Return the raw limits inside the physical ones."""
        return _up(low, number.fraction), _down(high, number.fraction)

    def widened(self, a: Term, q: int) -> Term:
        """Return an input, read from its word, at fraction `q`."""
        shift = q - a.number.fraction
        return a if shift == 0 else self.ops.emit("shl", (a, shift), _number(q), 0.0)

    # -- operations of the law ------------------------------------------------------------------------------------

    def binary(self, function: str, a: Operand, b: Operand, q: int) -> Operand:
        """add, sub, mul, min, max, lt, le, eq, ne of a law."""
        if function == "mul":
            return self._product(a, b, q)
        fraction = next(t.number.fraction for t in (a, b) if isinstance(t, Term))
        toward = {"min": _down, "max": _up}.get(function, _near)  # a limit is rounded to its inner side
        (x, x_error), (y, y_error) = (_operand(operand, fraction, toward) for operand in (a, b))
        error = max(x_error, y_error) if function in ("min", "max") else x_error + y_error
        return self.ops.emit(function, (x, y), _number(fraction), error)

    def unary(self, function: str, a: Operand, q: int) -> Operand:
        """neg, abs, square, twice, not of a law."""
        assert isinstance(a, Term)
        if function == "square":
            return self._product(a, a, q)
        if function == "twice":
            return self.binary("add", a, a, q)
        return self.ops.emit(function, (a,), a.number, a.error)

    def truth(self, function: str, a: Operand, b: Operand) -> Operand:
        """And, or of two truth values."""
        assert isinstance(a, Term) and isinstance(b, Term)
        return self.ops.emit(function, (a, b), a.number, a.error + b.error)

    def choose(self, condition: Operand, a: Operand, q: int) -> Operand:
        """Take `a` where the condition holds, else zero; near its edge the condition may choose unlike the law's."""
        assert isinstance(condition, Term)
        value, error = _operand(a, q, _near)
        flip = 0.0 if condition.error == 0.0 else _size(value, q) + error
        return self.ops.emit("select", (condition, value, 0), _number(q), max(error, flip))

    def store(self, a: Operand, number: Number, low: int, high: int, wish: tuple[str, str]) -> Term:
        """Bring `a` into the format of a state or output; saturate it at the raw limits where it could leave them."""
        target = _number(number.fraction)
        if isinstance(a, Constant):
            raw = min(max(self.literal(a.value, number), low), high)
            self.ops.wish = wish
            return self.ops.emit("copy", (raw,), target, _literal_error(a.value, raw, number.fraction))
        shift = a.number.fraction - number.fraction
        assert shift >= 0, "a stored value is never finer than what is stored"
        if shift:
            half = 1 << (shift - 1)
            inner_low, inner_high = max(low, -(-int(a.low) >> shift)), min(high, int(a.high) >> shift)
            if inner_low <= inner_high:  # nor may rounding pass a limit that `a` keeps
                low, high = inner_low, inner_high
            inside = low <= (int(a.low) + half) >> shift and (int(a.high) + half) >> shift <= high
            self.ops.wish = wish if inside else ("", "")
            rounded = a.error + 0.5 * 2.0**-number.fraction
            near = a.high + half <= WORD  # else the rounding constant could overflow: take the 64-bit form
            arguments = (a, shift) if near else (a, 1, shift)
            a = self.ops.emit("shr" if near else "mul_shift", arguments, target, rounded)
        if low <= a.low and a.high <= high:
            return a
        self.ops.wish = wish
        return self.ops.emit("clamp", (a, low, high), a.number, a.error + 2.0**-a.number.fraction)

    # -- products -------------------------------------------------------------------------------------------------

    def _product(self, a: Operand, b: Operand, q: int) -> Term:
        if isinstance(a, Constant):
            a, b = b, a
        assert isinstance(a, Term)
        if isinstance(b, Constant):
            shift, factor = _coefficient(b.value, a.number.fraction, q)
            error = _size(a, 0) * _literal_error(b.value, factor, q + shift - a.number.fraction)
            error += abs(b.value) * a.error
            return self._scaled(a, factor, shift, q, error)
        shift = a.number.fraction + b.number.fraction - q
        error = _size(a, 0) * b.error + (_size(b, 0) + b.error) * a.error
        return self._scaled(a, b, shift, q, error)

    def _scaled(self, a: Term, b: Term | int, shift: int, q: int, error: float) -> Term:
        wish, self.ops.wish = self.ops.wish, ("", "")
        if 24 <= shift < 32 and max(-a.low, a.high) * 2.0 ** (32 - shift) <= WORD:
            # The same product, with a left shift before it instead of a 64-bit one after it.
            a = self.ops.emit("shl", (a, 32 - shift), _number(a.number.fraction + 32 - shift), a.error)
            shift = 32
        self.ops.wish = wish
        if 1 <= shift <= 62:
            return self.ops.emit("mul_shift", (a, b, shift), _number(q), error + 0.5 * 2.0**-q)
        if shift == 0:
            return self.ops.emit("mul", (a, b), _number(q), error)
        raise QuantizeError(
            f"a product cannot be brought from Q{q + shift} to Q{q}: the ranges in the law are too far apart for "
            "fixed point; rescale the signals' units or use float32"
        )


def _coefficient(value: float, from_q: int, to_q: int) -> tuple[int, int]:
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
    raw = _near(value, to_q + shift - from_q)
    if raw == 0 or shift < 0 or natural >= FINEST:
        raise QuantizeError(
            f"the coefficient {value:g} cannot be held in fixed point beside the ranges it works on: it is too "
            f"{'large' if shift < 0 else 'small'}; rescale the signals' units or use float32"
        )
    return shift, raw


def _number(q: int) -> Number:
    return Number("fixed", 32, q)


def _operand(operand: Operand, fraction: int, toward: Callable[[float, int], int]) -> tuple[Term | int, float]:
    """Return an operand at `fraction` and its error; limits of outputs stand on the output's own grid."""
    if isinstance(operand, Term):
        assert operand.number.fraction == fraction, "values that meet share a format"
        return operand, operand.error
    if operand.grid is not None and operand.grid < fraction and toward is not _near:
        raw = toward(operand.value, operand.grid) << (fraction - operand.grid)
    else:
        raw = toward(operand.value, fraction)
    raw = min(max(raw, -WORD - 1), WORD)
    return raw, _literal_error(operand.value, raw, fraction)


def _size(a: Term | int, q: int) -> float:
    if isinstance(a, Term):
        return max(abs(a.low), abs(a.high)) * 2.0**-a.number.fraction
    return abs(a) * 2.0**-q


def _literal_error(value: float, raw: int, fraction: int) -> float:
    return abs(float(Fraction(value) - Fraction(raw) / Fraction(2) ** fraction))
