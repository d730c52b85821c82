"""Collect a Program's operations one by one, each with a name, a format and a bound that follows from its rule."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from firmloop.quantize.ops import EVERY, Interval, as_intervals
from firmloop.quantize.program import Number, Op, QuantizeError, Value

TRUTH = Number("fixed", 32, 0)


@dataclass(frozen=True, slots=True)
class Term:
    """A value as later operations see it.

    `low` and `high` bound the raw value; `error` bounds |program - law| in physical units. Where `share` is not 0,
    `rest` + `share` |value| does so too: a limit of the value then limits its error.
    """

    name: str
    number: Number
    low: float
    high: float
    error: float
    rest: float = 0.0
    share: float = 0.0


@dataclass(frozen=True, slots=True)
class Constant:
    """A real number that has not been given a format yet.

    A limit of an output also carries the fraction of that output, `grid`: a limit between two values of the output
    would be passed when the output is rounded.
    """

    value: float
    grid: int | None = None


Operand = Term | Constant


@dataclass(slots=True)
class Builder:
    """The operations so far. `wish` is the name and unit the next emitted result should carry."""

    body: list[Op] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)
    known: dict[tuple[object, ...], Term] = field(default_factory=dict)
    wish: tuple[str, str] = ("", "")

    def emit(self, function: str, arguments: tuple[Term | int | float, ...], number: Number, error: float) -> Term:
        """Append `function(arguments)` unless the same is there already; its bound is the operation's own rule."""
        name, unit = self.wish
        number = TRUTH if EVERY[function].truth else number
        texts = tuple(a.name if isinstance(a, Term) else a for a in arguments)
        key = (function, number, *texts)  # the same raw bits in another format are another value
        if key in self.known and not name:
            return self.known[key]
        intervals: list[Interval | int | float] = [(a.low, a.high) if isinstance(a, Term) else a for a in arguments]
        low, high = EVERY[function].bound(*as_intervals(function, intervals))
        self.wish = ("", "")
        value = Value(self.fresh(name or "t"), unit, number, low, high)
        self.check(value, function)
        self.body.append(Op(value, function, texts))
        term = Term(value.name, number, low, high, error)
        self.known[key] = term
        return term

    def widen(self, term: Term, margin: float, error: float) -> Term:
        """Widen the bound of the newest operation by `margin` on both sides and give it its error."""
        last = self.body[-1]
        if last.result.name != term.name:  # it was known already, and widened then
            return term
        low, high = term.low - margin, term.high + margin
        self.body[-1] = Op(replace(last.result, low=low, high=high), last.function, last.arguments)
        wider = Term(term.name, term.number, low, high, error)
        self.known[last.function, term.number, *last.arguments] = wider
        return wider

    def check(self, value: Value, function: str) -> None:
        """Assert that a fixed-point value fits the word it is computed in."""
        limit = 2 ** (value.number.bits - 1)
        if value.number.kind == "fixed" and not (-limit <= value.low and value.high <= limit - 1):
            raise QuantizeError(
                f"{value.name} = {function}(...) would reach {max(-value.low, value.high):g} raw in a "
                f"{value.number.bits}-bit word; "
                "narrow the ranges in [signals] or scale the controller"
            )

    def used(self, results: Iterable[str]) -> tuple[Op, ...]:
        """Return the operations that these results need, in order: what was left out of a sum is computed for none."""
        asked: set[str | int | float] = set(results)
        kept = []
        for op in reversed(self.body):
            if op.result.name in asked:
                kept.append(op)
                asked.update(op.arguments)
        return tuple(reversed(kept))

    def fresh(self, name: str) -> str:
        """Return `name`, or `name2`, `name3`, ... when taken; anonymous values are t1, t2, ..."""
        if name != "t" and name not in self.taken:
            self.taken.add(name)
            return name
        k = 1 if name == "t" else 2
        while f"{name}{k}" in self.taken:
            k += 1
        self.taken.add(f"{name}{k}")
        return f"{name}{k}"
