"""Give every value of a law a Q format and integer operations, from bounds proven as it goes.

All values are computed in 32-bit words. With 32-bit arithmetic a product is taken in 64 bits and rounded back; with
16-bit arithmetic inputs, outputs and coefficients have 16 bits and a product of two values is exact in 32 bits, so
sums and state keep 32 bits. No operation can overflow: each one's bound follows from its operands' bounds, and where
the law lets a value grow (state, outputs) the value saturates at its declared or proven range.

A value's format is the finest Q in which its bound fits. `error` follows the worst case of every rounding: half a unit
in the last place for each right shift, |x| times the coefficient's own rounding for each product.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

from quantize.builder import Builder, Constant, Operand, Term
from quantize.program import Number, QuantizeError

WORD = 2**31 - 1
FINEST, COARSEST = 56, -16  # Q range: beyond it a quantity is better given in another unit


def fit(low: float, high: float, bits: int) -> int:
    """Return the largest fraction at which [low, high] fits a signed word of `bits`."""
    size = max(abs(low), abs(high))
    if size == 0.0:
        return 0
    fraction = bits - 1 - math.frexp(size)[1]
    while round(size * 2.0**fraction) > 2 ** (bits - 1) - 1:
        fraction -= 1
    return min(fraction, FINEST)


def _down(value: float, fraction: int) -> int:
    return math.floor(Fraction(value) * Fraction(2) ** fraction)


def _up(value: float, fraction: int) -> int:
    return math.ceil(Fraction(value) * Fraction(2) ** fraction)


def _near(value: float, fraction: int) -> int:
    return math.floor(Fraction(value) * Fraction(2) ** fraction + Fraction(1, 2))


@dataclass(slots=True)
class FixedBuilder:
    """Emits integer operations; `word` is 16 or 32."""

    word: int
    ops: Builder = field(default_factory=Builder)

    def number(self, fraction: int, bits: int = 32) -> Number:
        """Return the format with this many fraction bits."""
        if fraction < COARSEST:
            raise QuantizeError(
                f"a value of the law would need Q{fraction} (units of {2.0**-fraction:g}); "
                "the range of a signal or a gain is too large for fixed point: rescale it or use float32"
            )
        return Number("fixed", bits, fraction)

    def signal(self, what: str, low: float, high: float, bits: int) -> Number:
        """Return the finest format in which a signal's whole range fits."""
        if not (math.isfinite(low) and math.isfinite(high)):
            raise QuantizeError(
                f"{what} has no finite proven range, so no fixed-point format is safe for it: "
                "limit it in the controller (an anti_windup mode, a limit) or use float32"
            )
        return self.number(fit(low, high, bits), bits)

    def literal(self, value: float, number: Number) -> int:
        """Return the raw value nearest to a physical one."""
        return _near(value, number.fraction)

    def limits(self, low: float, high: float, number: Number) -> tuple[int, int]:
        """Return the raw limits inside the physical ones."""
        return _up(low, number.fraction), _down(high, number.fraction)

    def argument(self, name: str, number: Number, low: float, high: float) -> Term:
        """Return an input or state as it stands in its struct; it carries no error of its own."""
        return Term(name, Number("fixed", 32, number.fraction), low, high, 0.0)

    # -- operations of the law ------------------------------------------------------------------------------------

    def binary(self, function: str, a: Operand, b: Operand) -> Operand:
        """add, sub, mul, min, max, lt, le, eq, ne of a law."""
        if isinstance(a, Constant) and isinstance(b, Constant):
            raise AssertionError("CasADi folds constants")
        if function == "mul":
            return self._product(a, b)
        (x, x_error), (y, y_error), fraction = self._aligned(function, a, b)
        error = max(x_error, y_error) if function in ("min", "max") else x_error + y_error
        return self.ops.emit(function, (x, y), self.number(fraction), error)

    def unary(self, function: str, a: Operand) -> Operand:
        """neg, abs, square, twice, not of a law."""
        assert isinstance(a, Term)
        if function == "square":
            return self._product(a, a)
        if function == "twice":
            return self.binary("add", a, a)
        return self.ops.emit(function, (a,), a.number, a.error)

    def truth(self, function: str, a: Operand, b: Operand) -> Operand:
        """And, or of two truth values."""
        assert isinstance(a, Term) and isinstance(b, Term)
        return self.ops.emit(function, (a, b), a.number, 0.0)

    def choose(self, condition: Operand, a: Operand) -> Operand:
        """Take `a` where the condition holds, else zero; near its edge the condition may choose unlike the law's."""
        assert isinstance(condition, Term)
        wish, self.ops.wish = self.ops.wish, ("", "")
        if isinstance(a, Constant):
            number = self.number(fit(a.value, a.value, self.word))
            raw = self.literal(a.value, number)
            a = self.ops.emit("copy", (raw,), number, _literal_error(a.value, raw, number.fraction))
        flip = 0.0 if condition.error == 0.0 else _size(a) + a.error
        self.ops.wish = wish
        return self.ops.emit("select", (condition, a, 0), a.number, max(a.error, flip))

    def store(self, a: Operand, number: Number, low: int, high: int, wish: tuple[str, str]) -> Term:
        """Bring `a` into the format of a state or output; saturate it at the raw limits where it could leave them."""
        fraction = number.fraction
        if isinstance(a, Constant):
            raw = min(max(self.literal(a.value, number), low), high)
            self.ops.wish = wish
            return self.ops.emit("copy", (raw,), self.number(fraction), _literal_error(a.value, raw, fraction))
        shift = a.number.fraction - fraction
        if shift < 0:  # limit before the left shift, or the shift could overflow
            a = self._limit(a, -((-low) >> -shift), high >> -shift)
            self.ops.wish = wish
            return self._align(a, fraction)
        half = (1 << shift) >> 1
        inner_low, inner_high = max(low, -(-int(a.low) >> shift)), min(high, int(a.high) >> shift)
        if inner_low <= inner_high:  # nor may rounding pass a limit that `a` keeps
            low, high = inner_low, inner_high
        if low <= (int(a.low) + half) >> shift and (int(a.high) + half) >> shift <= high:
            self.ops.wish = wish if shift else ("", "")
            return self._align(a, fraction)
        a = self._align(a, fraction)
        self.ops.wish = wish
        return self._limit(a, low, high)

    # -- formats --------------------------------------------------------------------------------------------------

    def _limit(self, a: Term, low: int, high: int) -> Term:
        if low <= a.low and a.high <= high:
            return a
        return self.ops.emit("clamp", (a, low, high), a.number, a.error + 2.0**-a.number.fraction)

    def _align(self, a: Term, fraction: int) -> Term:
        shift = a.number.fraction - fraction
        number = self.number(fraction)
        if shift == 0:
            return a
        if shift < 0:
            return self.ops.emit("shl", (a, -shift), number, a.error)
        error = a.error + 0.5 * 2.0**-fraction
        if shift <= 30 and a.high + (1 << (shift - 1)) <= WORD:
            return self.ops.emit("shr", (a, shift), number, error)
        return self.ops.emit("mul_shift", (a, 1, shift), number, error)

    def _aligned(
        self, function: str, a: Operand, b: Operand
    ) -> tuple[tuple[Term | int, float], tuple[Term | int, float], int]:
        """Bring two operands to one format, the finest in which both and the result fit."""
        wish, self.ops.wish = self.ops.wish, ("", "")
        terms = [t for t in (a, b) if isinstance(t, Term)]
        spans = [_span(t) for t in (a, b)]
        finest = max(t.number.fraction for t in terms)
        if function in ("add", "sub"):
            low, high = (
                (spans[0][0] + spans[1][0], spans[0][1] + spans[1][1])
                if function == "add"
                else (spans[0][0] - spans[1][1], spans[0][1] - spans[1][0])
            )
            finest = min(finest, fit(low, high, 32))
        room = spans if function in ("add", "sub") else [_span(t) for t in terms]
        finest = min([finest, *(fit(low, high, 32) for low, high in room)])
        toward = {"min": _down, "max": _up}.get(function, _near)  # a limit is rounded to its inner side
        out: list[tuple[Term | int, float]] = []
        for operand in (a, b):
            if isinstance(operand, Constant):
                raw = min(max(_on_grid(toward, operand, finest), -WORD - 1), WORD)
                out.append((raw, _literal_error(operand.value, raw, finest)))
            else:
                term = self._align(operand, finest)
                out.append((term, term.error))
        self.ops.wish = wish
        return out[0], out[1], finest

    def _product(self, a: Operand, b: Operand) -> Term:
        if isinstance(a, Constant):
            a, b = b, a
        assert isinstance(a, Term)
        wish, self.ops.wish = self.ops.wish, ("", "")
        if self.word == 16:
            a = self._narrow(a, 16)
        factor: Term | int
        if isinstance(b, Constant):
            factor, fraction, b_error = self._coefficient(b.value, a)
            b_law = abs(b.value)
        else:
            b = self._narrow(b, 15) if self.word == 16 else b
            factor, fraction, b_error, b_law = b, b.number.fraction, b.error, _size(b) + b.error
        exact = a.number.fraction + fraction
        low, high = _scaled_product(a, factor)
        error = _size(a) * b_error + b_law * a.error
        shift = self._shift(low, high, exact)
        self.ops.wish = wish
        if shift == 0:
            return self.ops.emit("mul", (a, factor), self.number(exact), error)
        number = self.number(exact - shift)
        error += 0.5 * 2.0**-number.fraction
        return self.ops.emit("mul_shift", (a, factor, shift), number, error)

    def _shift(self, low: int, high: int, exact: int) -> int:
        """Return how many bits to round off a product; 32 where that costs at most two, for many cores have it."""
        size = max(abs(low), abs(high))
        if self.word == 16 or size <= WORD:
            return max(0, exact - FINEST)
        least = max(size.bit_length() - 31, exact - FINEST)
        return 32 if 30 <= least <= 32 else least

    def _coefficient(self, value: float, a: Term) -> tuple[int, int, float]:
        """Return raw value, fraction and rounding error of a constant factor of `a`."""
        if self.word == 32:
            fraction = min(fit(value, value, 32), 62)
        else:
            largest = min(WORD // max(1, int(max(abs(a.low), abs(a.high)))), 2**15 - 1)
            fraction = min(15 - math.frexp(value)[1], 62)
            while abs(_near(value, fraction)) > largest:
                fraction -= 1
        raw = _near(value, fraction)
        if raw == 0 or fraction < -30:
            raise QuantizeError(
                f"the coefficient {value:g} cannot be held in {self.word}-bit fixed point: it is too "
                f"{'small' if raw == 0 else 'large'}; rescale the signals' units or use float32"
            )
        return raw, fraction, _literal_error(value, raw, fraction)

    def _narrow(self, a: Term, bits: int) -> Term:
        """Round `a` to at most `bits` magnitude bits, so that a product fits 32 bits."""
        size = int(max(abs(a.low), abs(a.high)))
        excess = max(0, size.bit_length() - bits)
        return self._align(a, a.number.fraction - excess) if excess else a


def _on_grid(toward: Callable[[float, int], int], limit: Constant, fraction: int) -> int:
    """Return the raw limit at `fraction`, moved to the inner side until the output it limits can take it exactly."""
    if limit.grid is None or limit.grid >= fraction:
        return toward(limit.value, fraction)
    return toward(limit.value, limit.grid) << (fraction - limit.grid)


def _span(a: Operand) -> tuple[float, float]:
    if isinstance(a, Constant):
        return a.value, a.value
    scale = 2.0**-a.number.fraction
    return a.low * scale, a.high * scale


def _size(a: Term) -> float:
    return max(abs(a.low), abs(a.high)) * 2.0**-a.number.fraction


def _literal_error(value: float, raw: int, fraction: int) -> float:
    return abs(float(Fraction(value) - Fraction(raw) / Fraction(2) ** fraction))


def _scaled_product(a: Term, b: Term | int) -> tuple[int, int]:
    span = (int(b.low), int(b.high)) if isinstance(b, Term) else (b, b)
    corners = [int(x) * y for x in (a.low, a.high) for y in span]
    return min(corners), max(corners)
