"""Emit a law's integer operations in the formats chosen for them, with bounds proven as they go.

All values are held in 32-bit words. A sum of products is taken in 64 bits and rounded once, a lone product is taken in
64 bits and rounded. With 16-bit arithmetic the inputs and outputs are 16-bit words. An input may hold every value of
its word. No operation can overflow: each one's bound follows from its operands' bounds, and where the law lets a value
grow (state, outputs) the value saturates at its declared or proven range.

A weight brings what it multiplies into the format of the sum: where it fits, the sum stands in the upper of two words
and needs no shift. `error` follows the worst case of every rounding: half a unit in the last place for each sum,
product and right shift, a whole one where they round down, |x| times the coefficient's own rounding for each constant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from firmloop.quantize.lower.builder import Builder, Constant, Operand, Term
from firmloop.quantize.lower.curves import CURVES
from firmloop.quantize.lower.places import (
    HIGH,
    WORD,
    Part,
    apart,
    bits,
    bits_alone,
    coefficient,
    exactly,
    near,
    nothing,
    seen,
    shifts,
    size,
    split,
    vanishes,
)
from firmloop.quantize.lower.products import FEW, FEWEST_IN_SUM, factor_of, one_by_one
from firmloop.quantize.lower.q_formats import WIDENED, fit
from firmloop.quantize.lower.words import ROUNDINGS, Dropping, down, ends, literal_error, number, operand, up
from firmloop.quantize.program import TOO_FAR, Number, QuantizeError, Value


@dataclass(slots=True)
class FixedBuilder:
    """Emits integer operations; `word` is the width of inputs and outputs, 16 or 32.

    The last argument of each operation, `q`, is the fraction of its result.
    """

    word: int
    rounding: Dropping = ROUNDINGS["nearest"]
    ops: Builder = field(default_factory=Builder)
    short: dict[str, Term] = field(default_factory=dict)  # the inputs themselves by the names they have when widened
    wide: frozenset[str] = frozenset()  # such names that something asks for in any case: nothing is won without them

    def signal(self, low: float, high: float, q: int) -> Number:
        """Return the format of an input or output: `q`, or the finest that fits its word."""
        return Number("fixed", self.word, min(fit(low, high, self.word), q))

    @property
    def unset(self) -> int:
        """What a state variable holds that only the first sample can set."""
        return -WORD - 1

    def held(self, low: float, high: float, number: Number) -> tuple[int, int]:
        """Return the raw limits of a state variable: the next power of two above its range."""
        power = 1 << max(0, math.frexp(max(abs(low), abs(high)))[1] + number.fraction)
        return -power, power - 1

    def read(self, value: Value) -> Term:
        """Return an input, which may hold every value of its word; a short one is widened."""
        half = 1 << (self.word - 1)
        raw = Term(f"in.{value.name}", replace(value.number, bits=32), -half, half - 1, 0.0)
        self.ops.wish = (f"{value.name}_wide", value.unit) if self.word < 32 else ("", "")
        found = self.widened(raw, raw.number.fraction + WIDENED[self.word])
        self.ops.wish = ("", "")
        if self.word < 32:
            self.short[found.name] = raw
        return found

    def fresh(self, probes: Sequence[Term], asks: str) -> Term:
        """Return whether this is the first sample."""
        del asks
        (probe,) = probes
        self.ops.wish = ("fresh", "")
        return self.ops.emit("eq", (probe, self.unset), probe.number, 0.0)

    def literal(self, value: float, number: Number) -> int:
        """Return the raw value nearest to a physical one."""
        return near(value, number.fraction)

    def limits(self, low: float, high: float, number: Number) -> tuple[int, int]:
        """Return the raw limits inside the physical ones."""
        return up(low, number.fraction), down(high, number.fraction)

    def widened(self, a: Term, q: int) -> Term:
        """Return a value at fraction `q`; where that is coarser, rounded down, or as a product if less than a unit."""
        raw = self.short.get(a.name)
        if raw is not None and raw.number.fraction <= q < a.number.fraction and a.name not in self.wide:
            a = raw
        shift = q - a.number.fraction
        if shift == 0:
            return a
        if a.low == a.high == 0:
            return self.ops.emit("copy", (0,), number(q), a.error)
        if vanishes(a, q):
            raise nothing(size(a, 0), q)
        if shift > 0:
            return self.ops.emit("shl", (a, shift), number(q), a.error)
        if int(a.low) >> -shift >= -1 and int(a.high) >> -shift <= 0:  # less than a unit: down would be only down
            error = a.error + self.rounding.error * 2.0**-q
            return self.ops.emit(self.rounding.product, (a, 1, -shift), number(q), error)
        return self.ops.emit("asr", (a, -shift), number(q), a.error + 2.0**-q)

    def _from_input(self, part: Part, q: int) -> Part:
        """Return a product of an input with a power of two as the input itself, moved, where no place is lost."""
        weight, term = part
        raw = self.short.get(term.name)
        if raw is None or term.number.fraction == q or not exactly(weight, raw, q):
            return part
        moved = self._moved(raw, abs(float(weight)), q)
        return part if moved is None else (Fraction(1 if weight > 0 else -1), moved)

    # -- sums -----------------------------------------------------------------------------------------------------

    def total(self, parts: Sequence[Part], constant: Fraction, q: int) -> Operand:
        """Return the sum of weight times value, and of `constant`, at fraction `q`."""
        kept, left_out = split(parts, q)
        found = self._total(kept, constant, q)
        return replace(found, error=found.error + left_out) if left_out and isinstance(found, Term) else found

    def _total(self, parts: Sequence[Part], constant: Fraction, q: int) -> Operand:
        parts = [p for pair in self._differences(parts) for p in pair]
        plain = all(abs(weight) == 1 for weight, _ in parts)
        parts = parts if plain else [self._from_input(p, q) for p in parts]
        if plain and len(parts) == 1 and constant and near(constant, q) == 0:
            raise QuantizeError(
                f"a value in units of {2.0**-q:g} is to be moved by {float(constant):g}, which is nothing there: give "
                "the limit or rate that asks for it a larger value, or use float32"
            )
        gone = [p for p in parts if plain and vanishes(p[1], q)]
        if gone:
            return self._left_out([p for p in parts if p not in gone], [term for _, term in gone], constant, q)
        whole = [p for p in parts if abs(p[0]) == 1 and (plain or p[1].number.fraction == q)]
        products = [p for p in parts if p not in whole]
        if not parts:
            return Constant(float(constant))
        if not whole and not constant and len(products) == 1:
            return seen([self._product(products[0][1], Constant(float(products[0][0])), q)], products, 1, q)[0]
        beside = len(whole) + (constant != 0)
        wish, self.ops.wish = self.ops.wish, ("", "")
        if all(exactly(weight, term, q) for weight, term in products):
            moved = [self._moved(term, abs(float(weight)), q) for weight, term in products]
            signs = [Fraction(1 if weight > 0 else -1) for weight, _ in products]
            whole, products = [*whole, *((s, t) for s, t in zip(signs, moved, strict=True) if t is not None)], []
        if not products:
            return self.plain(whole, constant, q, wish)
        shift, left = shifts(products, q)
        weak = [p for p, k in zip(products, left, strict=True) if bits(p, shift, q, k) < FEWEST_IN_SUM]
        if weak and bits_alone(weak, q):
            alone = [self._product(term, Constant(float(w)), q) for w, term in weak]
            kept = [p for p in products if p not in weak]
            whole = [*whole, *((Fraction(1), term) for term in (alone if kept else seen(alone, weak, beside, q)))]
            products, left = kept, [k for p, k in zip(products, left, strict=True) if p not in weak]
            if not products:
                return self.plain(whole, constant, q, wish)
        few = len(products) <= FEW[self.word] and self.rounding.adds and shift == HIGH and not weak
        if few and (beside or self.word < 32) and apart(products, whole, constant, q):
            return one_by_one(self, list(zip(products, left, strict=True)), whole, constant, q, wish)
        first = self.plain(whole, constant, q, ("", "")) if whole or constant else None
        wide = Number("fixed", 64, q + shift)
        total: Term | None = None
        error = self.rounding.error * 2.0**-q
        for (weight, term), k in zip(products, left, strict=True):
            a, factor, off = factor_of(self, weight, term, k, q + shift)
            error += off
            start = () if total is None else (total,)
            total = self.ops.emit("wide" if total is None else "mac", (*start, a, factor), wide, 0.0)
        assert total is not None
        if first is None:
            self.ops.wish = wish
        rounded = self.ops.emit(self.rounding.end, (total, shift), number(q), error)
        (rounded,) = seen([rounded], products, beside, q) if not weak else [rounded]
        if first is None:
            return rounded
        self.ops.wish = wish
        return self.ops.emit("add", (first, rounded), number(q), first.error + error)

    def _left_out(self, kept: Sequence[Part], gone: Sequence[Term], constant: Fraction, q: int) -> Operand:
        """Return the sum of `kept` and `constant` beside values that are nothing at its fraction, if it still adds."""
        if len(kept) + (constant != 0) < 2:
            raise nothing(max(size(term, 0) for term in gone), q)
        found = self._total(kept, constant, q)
        assert isinstance(found, Term)
        return replace(found, error=found.error + sum(size(term, 0) + term.error for term in gone))

    def _differences(self, parts: Sequence[Part]) -> list[list[Part]]:
        """Put two values of opposite weight together as one difference, where that fits a word; those come first."""
        left, found, rest = list(parts), [], []
        while left:
            weight, a = left.pop(0)
            for k, (other, b) in enumerate(left):
                fits = max(a.high - b.low, b.high - a.low) <= WORD
                if other == -weight and abs(weight) != 1 and a.number.fraction == b.number.fraction and fits:
                    wish, self.ops.wish = self.ops.wish, ("", "")
                    found.append([self._difference(weight, a, b)])
                    self.ops.wish = wish
                    left.pop(k)
                    break
            else:
                rest.append([(weight, a)])
        return found + rest

    def _difference(self, weight: Fraction, a: Term, b: Term) -> Part:
        """Return weight (a - b), or that of b - a; of two short inputs as they are, which is widened then."""
        q, known = a.number.fraction, self.ops.known
        if weight < 0:
            weight, a, b = -weight, b, a
        if a.name in self.short and b.name in self.short and not {a.name, b.name} & self.wide:
            a, b = self.short[a.name], self.short[b.name]
        if ("sub", a.number, a.name, b.name) not in known and ("sub", a.number, b.name, a.name) in known:
            weight, a, b = -weight, b, a
        return weight, self.widened(self.ops.emit("sub", (a, b), a.number, a.error + b.error), q)

    def plain(self, whole: Sequence[Part], constant: Fraction, q: int, wish: tuple[str, str]) -> Term:
        """Return the sum of values taken as they are."""
        ordered = sorted(whole, key=lambda part: part[0] < 0)
        weight, first = ordered[0] if ordered else (Fraction(1), None)
        steps = len(ordered) - 1 + (1 if constant else 0) + (1 if weight < 0 else 0)
        total = self.widened(first, q) if first is not None else None
        if total is None:
            self.ops.wish = wish
            raw = near(constant, q)
            return self.ops.emit("copy", (raw,), number(q), literal_error(constant, raw, q))

        def last() -> None:
            nonlocal steps
            steps -= 1
            self.ops.wish = wish if steps == 0 else ("", "")

        if weight < 0:
            last()
            total = self.ops.emit("neg", (total,), number(q), total.error)
        for weight, term in ordered[1:]:
            a = self.widened(term, q)
            last()
            total = self.ops.emit("add" if weight > 0 else "sub", (total, a), number(q), total.error + a.error)
        if constant:
            raw = near(constant, q)
            last()
            error = total.error + literal_error(constant, raw, q)
            total = self.ops.emit("add", (total, raw), number(q), error)
        return total

    # -- operations of the law ------------------------------------------------------------------------------------

    def binary(self, function: str, a: Operand, b: Operand, q: int) -> Operand:
        """Mul of two values, div, min, max, lt, le, eq, ne of a law."""
        if function == "mul":
            return self._product(a, b, q)
        if function == "div":
            return self.unary(function, b, q)  # of 1 over a value: see reciprocals.py
        fraction = next(t.number.fraction for t in (a, b) if isinstance(t, Term))
        toward = {"min": down, "max": up}.get(function, near)  # a limit is rounded to its inner side
        (x, x_error), (y, y_error) = (operand(each, fraction, toward) for each in (a, b))
        error = max(x_error, y_error) if function in ("min", "max") else x_error + y_error
        if function in ("eq", "ne") and isinstance(x, Term) and isinstance(y, Term):
            difference = self.ops.known.get(("sub", number(fraction), x.name, y.name))
            if difference is not None:  # no second one beside it: a compiler has its flags already
                x, y = difference, 0
        found = self.ops.emit(function, (x, y), number(fraction), error)
        shares = [t for t in (a, b) if isinstance(t, Term) and t.share > 0.0]
        if function not in ("min", "max") or not shares:
            return found
        # What the value is limited to, its error is: beyond the limit both are the limit's.
        (one,) = shares[:1]
        other = y_error if one is a else x_error
        limited = one.rest + one.share * size(found, 0) / (1.0 - one.share)
        return replace(found, error=min(error, max(limited, other)), rest=max(one.rest, other), share=one.share)

    def unary(self, function: str, a: Operand, q: int) -> Operand:
        """abs, square, not, sin, cos, sqrt of a law."""
        assert isinstance(a, Term)
        if function == "square":
            return self._product(a, a, q)
        if function in CURVES:
            return CURVES[function](self, a, q)
        return self.ops.emit(function, (a,), a.number, a.error)

    def truth(self, function: str, a: Operand, b: Operand) -> Operand:
        """And, or of two truth values."""
        assert isinstance(a, Term) and isinstance(b, Term)
        return self.ops.emit(function, (a, b), a.number, a.error + b.error)

    def choose(self, condition: Operand, a: Operand, b: Operand, q: int) -> Operand:
        """Take `a` where the condition holds, else `b`; near its edge the condition may choose unlike the law's."""
        assert isinstance(condition, Term)
        (one, one_error), (other, other_error) = (operand(each, q, near) for each in (a, b))
        error = max(one_error, other_error)
        if condition.error != 0.0:
            (low, high), (least, most) = ends(one), ends(other)
            error += max(high - least, most - low) * 2.0**-q
        return self.ops.emit("select", (condition, one, other), number(q), error)

    def inner(self, q: int) -> Number:
        """Return the format of what is computed at fraction `q`."""
        return number(q)

    def part(self, function: str, plan: Operand, q: int, *place: int) -> Operand:
        """Take a move or a status bit from a plan."""
        assert isinstance(plan, Term)
        return self.ops.emit(function, (plan, *place), self.inner(q), plan.error)

    def store(self, a: Operand, number: Number, low: int, high: int, wish: tuple[str, str]) -> Term:
        """Bring `a` into the format of a state or output; saturate it at the raw limits where it could leave them."""
        target = self.inner(number.fraction)
        if isinstance(a, Constant):
            raw = min(max(self.literal(a.value, number), low), high)
            self.ops.wish = wish
            return self.ops.emit("copy", (raw,), target, literal_error(a.value, raw, number.fraction))
        shift = a.number.fraction - number.fraction
        assert shift >= 0, "a stored value is never finer than what is stored"
        if shift and (a.low == a.high == 0 or vanishes(a, number.fraction)):
            self.ops.wish = wish
            return self.widened(a, number.fraction)
        if shift:
            down = self.rounding.shift == "asr"
            half = 0 if down else 1 << (shift - 1)
            inner_low, inner_high = max(low, -(-int(a.low) >> shift)), min(high, int(a.high) >> shift)
            if inner_low <= inner_high:  # nor may rounding pass a limit that `a` keeps
                low, high = inner_low, inner_high
            inside = low <= (int(a.low) + half) >> shift and (int(a.high) + half) >> shift <= high
            self.ops.wish = wish if inside else ("", "")
            if a.high + half <= WORD and shift < 31:
                rounded = a.error + self.rounding.error * 2.0**-number.fraction
                a = self.ops.emit(self.rounding.shift, (a, shift), target, rounded)
            else:  # the rounding constant could overflow
                a = self.ops.emit("asr", (a, shift), target, a.error + 2.0**-number.fraction)
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
            moved = self._moved(a, b.value, q)
            if moved is not None:
                return moved
            shift, factor = coefficient(b.value, a.number.fraction, q)
            error = size(a, 0) * literal_error(b.value, factor, q + shift - a.number.fraction)
            error += abs(b.value) * a.error
            return self._scaled(a, factor, shift, q, error)
        shift = a.number.fraction + b.number.fraction - q
        grown = (size(b, 0) + b.error) * a.error
        found = self._scaled(a, b, shift, q, size(a, 0) * b.error + grown)
        least = b.low * 2.0**-b.number.fraction
        if not 0.0 < b.error < least:
            return found
        return replace(found, rest=grown + self.rounding.error * 2.0**-q, share=b.error / least)

    def _moved(self, a: Term, value: float, q: int) -> Term | None:
        """Return the same product by a shift alone, where the constant is a power of two and the shift is possible."""
        mantissa, exponent = math.frexp(value)
        shift = q - a.number.fraction + exponent - 1
        if mantissa != 0.5 or not -30 <= shift <= 30:
            return None
        error = value * a.error
        if shift >= 0:
            return self.ops.emit("shl" if shift else "copy", (a, shift)[: 2 if shift else 1], number(q), error)
        if a.high + (1 << (-shift - 1)) > WORD:  # the rounding constant could overflow
            return None
        return self.ops.emit(self.rounding.shift, (a, -shift), number(q), error + self.rounding.error * 2.0**-q)

    def _scaled(self, a: Term, b: Term | int, shift: int, q: int, error: float) -> Term:
        wish, self.ops.wish = self.ops.wish, ("", "")
        if 24 <= shift < 32 and max(-a.low, a.high) * 2.0 ** (32 - shift) <= WORD:
            # The same product, with a left shift before it instead of a 64-bit one after it.
            a = self.ops.emit("shl", (a, 32 - shift), number(a.number.fraction + 32 - shift), a.error)
            shift = 32
        self.ops.wish = wish
        if 1 <= shift <= 62:
            return self.ops.emit(self.rounding.product, (a, b, shift), number(q), error + self.rounding.error * 2.0**-q)
        if shift == 0:
            return self.ops.emit("mul", (a, b), number(q), error)
        raise QuantizeError(f"a product cannot be brought from Q{q + shift} to Q{q}: {TOO_FAR}")
