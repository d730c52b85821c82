"""Write the values of a fixed-point program as exact sums of state, inputs and roundings, near one point.

A rounding adds a symbol of its own, at most half a unit either way. A limit that does not act at the point, a
comparison and a choice add a condition: how far a sum may move before another line would hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from firmloop.verify.proofs.claims import Argument, ClaimedOperation, Claims, ProofError

HALF = Fraction(1, 2)


@dataclass(frozen=True, slots=True)
class ExactForm:
    """constant + sum of parts: factors by `self.<state>`, `in.<input>`, or the operation that rounds."""

    constant: Fraction
    parts: Mapping[str, Fraction] = field(default_factory=dict)

    def plus(self, other: ExactForm, factor: Fraction = Fraction(1)) -> ExactForm:
        """Return self + factor other."""
        parts = dict(self.parts)
        for name, value in other.parts.items():
            parts[name] = parts.get(name, Fraction(0)) + factor * value
        return ExactForm(
            self.constant + factor * other.constant, {name: value for name, value in parts.items() if value}
        )

    def times(self, factor: Fraction) -> ExactForm:
        """Return the product with a number."""
        return ExactForm(Fraction(0)).plus(self, factor)


@dataclass(frozen=True, slots=True)
class Condition:
    """What holds while |form - its value at the point| is at most `margin`, or below it where it is `strict`."""

    says: str
    form: ExactForm
    margin: Fraction
    strict: bool


class NearPoint:
    """The forms of one program near `point`, the values of its states and inputs there."""

    def __init__(self, claims: Claims, point: Mapping[str, Fraction]) -> None:
        self._ops = {op.result.name: op for op in claims.operations}
        self._point = point
        self._known: dict[str, ExactForm] = {}
        self.conditions: list[Condition] = []

    def form(self, argument: Argument) -> ExactForm:
        """Return the form of a value.

        Raises
        ------
        ProofError
            when the program is not a sum of its state and inputs there.
        """
        if not isinstance(argument, str):
            return ExactForm(Fraction(argument))
        if argument.startswith(("self.", "in.")):
            return ExactForm(Fraction(0), {argument: Fraction(1)})
        if argument not in self._known:
            self._known[argument] = self._result(self._ops[argument])
        return self._known[argument]

    def value(self, form: ExactForm) -> Fraction:
        """Return what it is at the point; roundings count as their middle."""
        return form.constant + sum(
            (factor * self._point.get(name, Fraction(0)) for name, factor in form.parts.items()), Fraction(0)
        )

    def _result(self, op: ClaimedOperation) -> ExactForm:
        given = op.arguments
        if op.function == "select":
            return self.form(given[1] if self._truth(op, given[0]) else given[2])
        if op.function in ("lt", "le", "eq", "ne", "and", "or", "not"):
            return ExactForm(Fraction(self._decided(op)))
        rule = _SUMS.get(op.function) or _LIMITED.get(op.function)
        if rule is None:
            raise ProofError(f"{op.says()} is no sum of state and inputs")
        return rule(self, op)

    def _truth(self, op: ClaimedOperation, argument: Argument) -> bool:
        form = self.form(argument)
        if form.parts:
            raise ProofError(f"{op.says()} chooses by a value that moves")
        return form.constant != 0

    def _decided(self, op: ClaimedOperation) -> bool:
        if op.function in ("and", "or", "not"):
            truths = [self._truth(op, argument) for argument in op.arguments]
            return {"and": all(truths), "or": any(truths), "not": not truths[0]}[op.function]
        one, other = (self.form(argument) for argument in op.arguments)
        apart = one.plus(other, Fraction(-1))
        value = self.value(apart)
        if apart.parts:
            if value == 0:
                raise ProofError(f"{op.says()} compares two values that are equal at rest")
            self.conditions.append(Condition(op.says(), apart, abs(value), strict=True))
        return {"lt": value < 0, "le": value <= 0, "eq": value == 0, "ne": value != 0}[op.function]

    def limited(self, op: ClaimedOperation, form: ExactForm, low: Fraction | None, high: Fraction | None) -> ExactForm:
        """Return a value between limits: itself where it is inside, else the limit that acts."""
        value = self.value(form)
        for end, beyond in ((low, low is not None and value < low), (high, high is not None and value > high)):
            if beyond and end is not None:
                self.conditions.append(Condition(op.says(), form, abs(value - end), strict=False))
                return ExactForm(end)
        room = [abs(value - end) for end in (low, high) if end is not None]
        self.conditions.append(Condition(op.says(), form, min(room), strict=False))
        return form

    def product(self, op: ClaimedOperation, one: Argument, other: Argument) -> ExactForm:
        """Return a product of which one factor stands still."""
        a, b = self.form(one), self.form(other)
        if a.parts and b.parts:
            raise ProofError(f"{op.says()} multiplies two values that move")
        return b.times(a.constant) if not a.parts else a.times(b.constant)


def _rounded(op: ClaimedOperation, form: ExactForm, places: Argument, down: Fraction) -> ExactForm:
    """Return form / 2**places and a rounding around -down of a unit."""
    scaled = form.times(Fraction(1, 1 << int(places)))
    return scaled.plus(ExactForm(-down, {f"rounding of {op.result.name}": Fraction(1)})) if places else scaled


def _wrapped(near: NearPoint, op: ClaimedOperation) -> ExactForm:
    form, half = near.form(op.arguments[0]), Fraction(1 << (31 - int(op.arguments[1])))
    if not -half <= near.value(form) <= half - 1:
        raise ProofError(f"{op.says()} leaves bits out at rest")
    return near.limited(op, form, -half, half - 1)


def _magnitude(near: NearPoint, op: ClaimedOperation) -> ExactForm:
    form = near.form(op.arguments[0])
    value = near.value(form)
    if value == 0 and form.parts:
        raise ProofError(f"{op.says()} turns at rest")
    return (
        near.limited(op, form, Fraction(0), None)
        if value >= 0
        else near.limited(op, form.times(Fraction(-1)), Fraction(0), None)
    )


def _between(near: NearPoint, op: ClaimedOperation, low: Argument | None, high: Argument | None) -> ExactForm:
    ends = [None if end is None else near.form(end) for end in (low, high)]
    if any(end is not None and end.parts for end in ends):
        return _nearer(near, op)
    return near.limited(op, near.form(op.arguments[0]), *(None if end is None else end.constant for end in ends))


def _nearer(near: NearPoint, op: ClaimedOperation) -> ExactForm:
    """Return the smaller or larger of two values that both move."""
    if op.function == "clamp":
        raise ProofError(f"{op.says()} has limits that move")
    one, other = (near.form(argument) for argument in op.arguments)
    apart = one.plus(other, Fraction(-1))
    value = near.value(apart)
    if not apart.parts and value == 0:
        return one
    near.conditions.append(Condition(op.says(), apart, abs(value), strict=False))
    return one if (value < 0) == (op.function == "min") else other


_SUMS: Mapping[str, Callable[[NearPoint, ClaimedOperation], ExactForm]] = {
    "add": lambda near, op: near.form(op.arguments[0]).plus(near.form(op.arguments[1])),
    "sub": lambda near, op: near.form(op.arguments[0]).plus(near.form(op.arguments[1]), Fraction(-1)),
    "neg": lambda near, op: near.form(op.arguments[0]).times(Fraction(-1)),
    "copy": lambda near, op: near.form(op.arguments[0]),
    "mul": lambda near, op: near.product(op, *op.arguments[:2]),
    "wide": lambda near, op: near.product(op, *op.arguments[:2]),
    "mac": lambda near, op: near.form(op.arguments[0]).plus(near.product(op, *op.arguments[1:3])),
    "mul_add": lambda near, op: near.form(op.arguments[0]).plus(
        _rounded(op, near.product(op, *op.arguments[1:3]), 32, Fraction(0))
    ),
    "mul_add_short": lambda near, op: near.form(op.arguments[0]).plus(
        _rounded(op, near.product(op, *op.arguments[1:3]), 16, HALF)
    ),
    "shl": lambda near, op: near.form(op.arguments[0]).times(Fraction(1 << int(op.arguments[1]))),
    "mul_shift": lambda near, op: _rounded(op, near.product(op, *op.arguments[:2]), op.arguments[2], Fraction(0)),
    "mul_down": lambda near, op: _rounded(op, near.product(op, *op.arguments[:2]), op.arguments[2], HALF),
    "high": lambda near, op: _rounded(op, near.form(op.arguments[0]), op.arguments[1], Fraction(0)),
    "shr": lambda near, op: _rounded(op, near.form(op.arguments[0]), op.arguments[1], Fraction(0)),
    "high_down": lambda near, op: _rounded(op, near.form(op.arguments[0]), op.arguments[1], HALF),
    "asr": lambda near, op: _rounded(op, near.form(op.arguments[0]), op.arguments[1], HALF),
}
_LIMITED: Mapping[str, Callable[[NearPoint, ClaimedOperation], ExactForm]] = {
    "clamp": lambda near, op: _between(near, op, op.arguments[1], op.arguments[2]),
    "min": lambda near, op: _between(near, op, None, op.arguments[1]),
    "max": lambda near, op: _between(near, op, op.arguments[1], None),
    "wrap": _wrapped,
    "abs": _magnitude,
}
