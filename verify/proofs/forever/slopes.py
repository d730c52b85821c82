"""Evaluate a plant's entries over a box of parameters: intervals of values and of slopes, with exact ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt

from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.forever.stated import Interval, PlantEquations

ZERO: Interval = (Fraction(0), Fraction(0))
_FINE = 1 << 256  # square roots are taken to a part of it


@dataclass(frozen=True, slots=True)
class Slope:
    """The interval of a value over a box, and those of its slopes along each parameter."""

    value: Interval
    along: tuple[Interval, ...]


def add(a: Interval, b: Interval) -> Interval:
    """Return the interval of a sum."""
    return a[0] + b[0], a[1] + b[1]


def negative(a: Interval) -> Interval:
    """Return the interval of -a."""
    return -a[1], -a[0]


def multiply(a: Interval, b: Interval) -> Interval:
    """Return the interval of a product."""
    corners = [x * y for x in a for y in b]
    return min(corners), max(corners)


def inverse(a: Interval) -> Interval:
    """Return the interval of 1 / a."""
    if a[0] <= 0 <= a[1]:
        raise ProofError("loop.json: an equation of the plant divides by an interval that holds 0")
    return 1 / a[1], 1 / a[0]


def root(value: Fraction) -> Fraction:
    """Return a bound from above of the square root, close to it."""
    return Fraction(isqrt(value.numerator * _FINE * _FINE // value.denominator) + 1, _FINE)


def evaluate(held: PlantEquations, box: Sequence[Interval]) -> list[Slope]:
    """Return every operation's interval over `box`, one interval a parameter.

    Raises
    ------
    ProofError
        when an operation is none of the field's, or divides by zero.
    """
    none = tuple(ZERO for _ in box)
    found: list[Slope] = []
    for k, (function, given) in enumerate(held.operations):
        if function == "number" and len(given) == 1:
            found.append(Slope((given[0], given[0]), none))
            continue
        if any(x.denominator != 1 for x in given):
            raise ProofError(f"loop.json: operation {k} of the plant takes no whole number")
        at = [int(x) for x in given]
        if function == "parameter" and len(at) == 1 and 0 <= at[0] < len(box):
            one = tuple((Fraction(j == at[0]), Fraction(j == at[0])) for j in range(len(box)))
            found.append(Slope(box[at[0]], one))
        elif all(0 <= x < k for x in at):
            found.append(_result(function, [found[x] for x in at]))
        else:
            raise ProofError(f"loop.json: operation {k} of the plant reads what is not there yet")
    return found


def _result(function: str, given: Sequence[Slope]) -> Slope:
    match function, given:
        case "add", [a, b]:
            return Slope(add(a.value, b.value), tuple(map(add, a.along, b.along)))
        case "sub", [a, b]:
            return _result("add", [a, _result("neg", [b])])
        case "neg", [a]:
            return Slope(negative(a.value), tuple(map(negative, a.along)))
        case "mul", [a, b]:
            along = (add(multiply(x, b.value), multiply(y, a.value)) for x, y in zip(a.along, b.along, strict=True))
            return Slope(multiply(a.value, b.value), tuple(along))
        case "inv", [a]:
            by = inverse(a.value)
            turned = negative(multiply(by, by))
            return Slope(by, tuple(multiply(x, turned) for x in a.along))
        case "div", [a, b]:
            return _result("mul", [a, _result("inv", [b])])
        case "sq", [a]:
            return _result("mul", [a, a])
        case "twice", [a]:
            return _result("add", [a, a])
    raise ProofError(f"loop.json: {function} of {len(given)} is no operation of a plant here")
