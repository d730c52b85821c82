"""Give every value of a law a float type and a bound, and follow what each rounding can do to it.

One operation in round-to-nearest adds at most half a unit in the last place of its largest result, u 2**floor(log2
|result|), plus half the smallest subnormal (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2.2), u =
2**-24 in float32 and 2**-53 in float64. Who measures the difference has to evaluate the law in numbers too, float64
beside a float32 program and long double beside a float64 one: that rounding is part of the bound. Where a sum is
limited to a range, its own rounding matters only where law or program is within that range: beyond it both stand at the
limit. Neither inputs nor state are limited: bounds hold while inputs keep their ranges, and state keeps its range by
the controller's own argument. A state that an overflow has made infinite or no number is found in the next sample,
and the controller starts afresh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from firmloop.quantize.lower.builder import Builder, Constant, Operand, Term
from firmloop.quantize.program import Number, QuantizeError, Value
from firmloop.quantize.twins.elementary import BEYOND_ONE, EXP_ERROR, SIN_ERROR, exponential_bound
from firmloop.quantize.twins.root import ROOT_ERROR, SMALLEST

LAW = {32: 2.0**-53, 64: 2.0**-64}  # rounding of the law's own evaluation, in float64 and in long double


@dataclass(slots=True)
class FloatBuilder:
    """Emits floating-point operations; `bits` is 32 or 64."""

    bits: int
    ops: Builder = field(default_factory=Builder)
    inherited: dict[str, float] = field(default_factory=dict)  # the part of a value's error that its operands bring

    @property
    def _unit(self) -> float:
        return 2.0**-24 if self.bits == 32 else 2.0**-53

    @property
    def _tiny(self) -> float:
        return 2.0**-150 if self.bits == 32 else 2.0**-1074

    def signal(self, low: float, high: float, q: int) -> Number:
        """Return the one format of every value."""
        del low, high, q
        return Number("float", self.bits, 0)

    @property
    def unset(self) -> float:
        """What a state variable holds that only the first sample can set."""
        return math.nan

    def held(self, low: float, high: float, number: Number) -> tuple[float, float]:
        """Return the range of a state variable."""
        return self.limits(low, high, number)

    def read(self, value: Value) -> Term:
        """Return an input; every bound holds while it keeps its range."""
        return Term(f"in.{value.name}", value.number, value.low, value.high, 0.0)

    def fresh(self, probes: Sequence[Term], asks: str) -> Term:
        """Return whether this is the first sample, or the state was lost; `asks` is "lost", or "none" if it will do."""
        total: Operand = probes[0]
        for probe in probes[1:]:
            total = self.binary("add", total, probe)
        assert isinstance(total, Term)
        self.ops.wish = ("fresh", "")
        return self.ops.emit(asks, (total,), total.number, 0.0)

    def gone(self, asks: str, a: Operand) -> Term:
        """Return whether a value is lost; never in the law's ranges, where the error is followed."""
        assert isinstance(a, Term)
        return self.ops.emit(asks, (a,), a.number, 0.0)

    def total(self, parts: Sequence[tuple[Fraction, Term]], constant: Fraction, q: int) -> Operand:
        """Refuse: floating point adds up in the law's own order."""
        raise AssertionError("no sum is gathered in floating point")

    def literal(self, value: float, number: Number) -> float:
        """Return the nearest representable value."""
        del number
        with np.errstate(over="ignore"):
            found = float(np.float32(value)) if self.bits == 32 else float(value)
        if math.isfinite(value) and (not math.isfinite(found) or (found == 0.0) != (value == 0.0)):
            raise QuantizeError(
                f"the number {value:g} of the law is {'0' if found == 0.0 else 'beyond every value'} in float32; "
                "rescale the signals' units or use float64"
            )
        return found

    def limits(self, low: float, high: float, number: Number) -> tuple[float, float]:
        """Return the representable limits inside the given ones."""
        return self._up(low, number), -self._up(-high, number)

    def widened(self, a: Term, q: int) -> Term:
        """Return an input as it was read."""
        del q
        return a

    # -- operations of the law ------------------------------------------------------------------------------------

    def binary(self, function: str, a: Operand, b: Operand, q: int = 0) -> Operand:
        """add, sub, mul, min, max, lt, le, eq, ne of a law."""
        del q
        number = Number("float", self.bits, 0)
        x, x_error = self._operand(function, a, number)
        y, y_error = self._operand(function, b, number)
        if function in ("min", "max"):
            term = self.ops.emit(function, (x, y), number, max(x_error, y_error))
            if math.isfinite(term.error):
                return self._limited(term, x, y, y_error)
            # Both the program's value and the law's lie between the limits, the law's own ones.
            return self.ops.widen(term, 0.0, term.high - term.low + min(x_error, y_error))
        if function in ("lt", "le", "eq", "ne"):
            return self.ops.emit(function, (x, y), number, x_error + y_error)
        error = x_error + y_error
        if function == "div":
            least = min(abs(end) for end in _ends(y)) if _ends(y)[0] > 0 or _ends(y)[1] < 0 else 0.0
            error = (x_error + _times(_size(x) / least, y_error)) / (least - y_error) if least > y_error else math.inf
        if function == "mul":
            error = _times(_size(x), y_error) + _times(_size(y) + y_error, x_error)
        return self._rounded(self.ops.emit(function, (x, y), number, error))

    def unary(self, function: str, a: Operand, q: int) -> Operand:
        """neg, abs, square, twice of a law."""
        del q
        assert isinstance(a, Term)
        if function in ("square", "twice"):
            return self.binary("mul" if function == "square" else "add", a, a)
        if function in ("sin", "cos", "tanh"):
            own = self._unit * (SIN_ERROR + (_size(a) if function != "tanh" else 0.0))
            return self.ops.emit(function, (a,), a.number, min(a.error + own, 2 * BEYOND_ONE))
        if function == "sqrt":
            # Near 0 the root is steeper than any line: what is e apart there is the root of e apart.
            inside = a.low - a.error
            brought = a.error / (2.0 * math.sqrt(inside)) if inside > a.error else math.sqrt(a.error)
            own = self._unit * ROOT_ERROR * math.sqrt(a.high + a.error) + math.sqrt(SMALLEST["f4"])
            return self.ops.emit(function, (a,), a.number, brought + own)
        if function == "exp":
            top = exponential_bound((a.low, a.high + a.error))[1]
            return self.ops.emit(function, (a,), a.number, top * (a.error + self._unit * (EXP_ERROR + _size(a))))
        return self.ops.emit(function, (a,), a.number, a.error)

    def truth(self, function: str, a: Operand, b: Operand) -> Operand:
        """And, or of two truth values."""
        assert isinstance(a, Term) and isinstance(b, Term)
        return self.ops.emit(function, (a, b), a.number, a.error + b.error)

    def limit(self, function: str, a: Operand, low: Operand, high: Operand) -> Operand:
        """Clamp to two constants, ask whether that would change `a`, or, where it would, to which.

        There the limit is what clamping gives, with the same error; what it is elsewhere, nobody reads.
        """
        assert isinstance(a, Term) and isinstance(low, Constant) and isinstance(high, Constant)
        ends = (self._up(low.value, a.number), -self._up(-high.value, a.number))
        inner = max(abs(ends[0] - low.value), abs(ends[1] - high.value))
        error = self._within(a, max(abs(low.value), abs(high.value)))
        if function != "outside" and not error <= high.value - low.value:  # both values are within
            error = high.value - low.value
        return self.ops.emit(function, (a, *ends), a.number, max(error, inner))

    def choose(self, condition: Operand, a: Operand, b: Operand, q: int) -> Operand:
        """Take `a` where the condition holds, else `b`; near its edge the condition may choose unlike the law's."""
        del q
        assert isinstance(condition, Term)
        number = Number("float", self.bits, 0)
        (one, one_error), (other, other_error) = (self._operand("select", operand, number) for operand in (a, b))
        error = max(one_error, other_error)
        if condition.error != 0.0:
            (low, high), (least, most) = _ends(one), _ends(other)
            error += max(high - least, most - low)
        return self.ops.emit("select", (condition, one, other), number, error)

    def inner(self, q: int) -> Number:
        """Return the format of what is computed at fraction `q`."""
        del q
        return Number("float", self.bits, 0)

    def course(self, table: str, routine: str, parameters: list[Operand]) -> Operand:
        """Take a step in the nonlinear program of a table; what it differs by from the law's is not followed."""
        number = Number("float", self.bits, 0)
        read, called = (Term(name, number, 0.0, 0.0, 0.0) for name in (f"table.{table}", f"routine.{routine}"))
        given = [p if isinstance(p, Term) else self.literal(p.value, number) for p in parameters]
        return self.ops.emit("improve", (read, called, *given), number, math.inf)

    def part(self, function: str, plan: Operand, q: int, *place: int) -> Operand:
        """Take a move or a status bit from a plan."""
        assert isinstance(plan, Term)
        return self.ops.emit(function, (plan, *place), self.inner(q), plan.error)

    def store(self, a: Operand, number: Number, low: float, high: float, wish: tuple[str, str]) -> Term:
        """Return the value a state or output takes; a bare constant gets a name first."""
        del low, high
        if isinstance(a, Constant):
            self.ops.wish = wish
            value = self.literal(a.value, number)
            return self.ops.emit("copy", (value,), number, abs(value - a.value))
        return a

    # -- bounds ---------------------------------------------------------------------------------------------------

    def _operand(self, function: str, a: Operand, number: Number) -> tuple[Term | float, float]:
        if isinstance(a, Term):
            return a, a.error
        if function == "min":
            value = -self._up(-a.value, number)
        elif function == "max":
            value = self._up(a.value, number)
        else:
            value = self.literal(a.value, number)
        return value, abs(value - a.value) if math.isfinite(a.value) else 0.0

    def _rounded(self, term: Term) -> Term:
        """Widen the bound and the error of the operation just emitted by one rounding, and by the law's own."""
        size = max(abs(term.low), abs(term.high))
        error = term.error + self._own(size, term.error)
        margin = self._half(size)
        self.inherited[term.name] = term.error
        return self.ops.widen(term, margin, error)

    def _half(self, size: float) -> float:
        """Return half a unit in the last place of the largest result that can be rounded."""
        if not math.isfinite(size) or size == 0.0:
            return size
        return max(self._unit * 2.0 ** (math.frexp(size)[1] - 1), self._tiny)

    def _own(self, size: float, error: float) -> float:
        """Return what rounding a result of magnitude `size` adds in program and law, which are `error` apart."""
        reached = size + error
        place = 2.0 ** math.floor(math.log2(reached)) if 0.0 < reached < math.inf else reached
        return self._unit * place + LAW[self.bits] * reached + self._tiny

    def _limited(self, term: Term, x: Term | float, y: Term | float, limit_error: float) -> Term:
        """Give a value that has just been limited by a constant the error of a result within the limits."""
        if not isinstance(x, Term) or isinstance(y, Term) or x.name not in self.inherited:
            return term
        inherited = self.inherited[term.name] = self.inherited[x.name]
        error = inherited + self._own(_size(term) + x.error, inherited)
        return self.ops.widen(term, 0.0, min(term.error, max(error, limit_error)))

    def _within(self, a: Term, size: float) -> float:
        """Return how far `a` can be off where it is limited to magnitude `size`.

        Rounding keeps the order of numbers: what is beyond a limit before it is rounded is not inside after it. So the
        last rounding counts only for values within the limits, and beyond them only what the operands bring.
        """
        if a.name not in self.inherited:
            return a.error
        inherited = self.inherited[a.name]
        return min(a.error, inherited + self._own(size, inherited))

    def _up(self, value: float, number: Number) -> float:
        """Return the smallest representable number not below `value`."""
        near = self.literal(value, number)
        if near >= value:
            return near
        kind = np.float32 if self.bits == 32 else np.float64
        return float(np.nextafter(kind(near), kind(math.inf)))


def _size(a: Term | float) -> float:
    return max(abs(a.low), abs(a.high)) if isinstance(a, Term) else abs(a)


def _ends(a: Term | float) -> tuple[float, float]:
    return (a.low, a.high) if isinstance(a, Term) else (a, a)


def _times(a: float, b: float) -> float:
    return 0.0 if a == 0.0 or b == 0.0 else a * b
