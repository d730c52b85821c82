"""Multiply the values of a sum by their weights, and round few products one by one, each as it is added.

A core that multiplies, rounds and adds in one instruction takes one for each product then, and none for their sum. Each
is half a unit in the last place off, not their sum: an output of 16 bits sees nothing of that. With one product beside
values that are taken as they are, it is the same number. An input of 16 bits need not be widened for it: such cores
multiply 16 by 32 bits too, and round down then, a whole unit off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Protocol

from firmloop.quantize.lower.builder import Builder, Term
from firmloop.quantize.lower.places import HIGH, Part, near, size
from firmloop.quantize.lower.words import Dropping, literal_error, number
from firmloop.quantize.program import Op, QuantizeError

FEWEST_IN_SUM = 18  # of a weight in a sum: a gain is then right to 4e-6, else it gets a product of its own
FEW = {16: 3, 32: 1}  # products of a sum by the word of inputs and outputs; more stay one sum, which other cores add
SHORT = 16  # bits of a short input, and the shift behind its product
Wish = tuple[str, str]


class Summing(Protocol):
    """What a sum needs of a builder."""

    ops: Builder
    rounding: Dropping
    short: dict[str, Term]
    wide: frozenset[str]

    def widened(self, a: Term, q: int) -> Term:
        """Return a value at fraction `q`."""
        ...

    def plain(self, whole: Sequence[Part], constant: Fraction, q: int, wish: Wish) -> Term:
        """Return the sum of values taken as they are."""
        ...


def factor_of(summing: Summing, weight: Fraction, term: Term, left: int, q: int) -> tuple[Term, int, float]:
    """Return a value shifted to the left, what makes it a product at fraction `q`, and by how much that is off."""
    a = summing.widened(term, term.number.fraction + left)
    factor = near(weight, q - a.number.fraction)
    if factor == 0:
        raise QuantizeError(
            f"the coefficient {float(weight):g} cannot be held in fixed point beside the ranges it works on: "
            "it is too small; rescale the signals' units or use float32"
        )
    error = size(a, 0) * literal_error(weight, factor, q - a.number.fraction)
    return a, factor, error + abs(float(weight)) * a.error


def short_factor(summing: Summing, weight: Fraction, term: Term, q: int) -> tuple[Term, int, float] | None:
    """Return an input of 16 bits, the factor that `mul_add_short` takes, and by how much the product is off.

    None where the value is no such input or is widened anyway, or the factor does not fit its word or has too few bits.
    """
    raw = summing.short.get(term.name)
    if raw is None or term.name in summing.wide:
        return None
    factor = near(weight, q + SHORT - raw.number.fraction)
    if not FEWEST_IN_SUM <= abs(factor).bit_length() < HIGH:
        return None
    return raw, factor, size(raw, 0) * literal_error(weight, factor, q + SHORT - raw.number.fraction) + 2.0**-q


def better_wide(body: Sequence[Op], short: Mapping[str, Term]) -> frozenset[str]:
    """Return the names, when widened, of the short inputs that are better widened wherever they are taken.

    Those are what some operation takes widened in any case, and both of a difference of which only one is multiplied
    as it is: the shift of the other one is part of a subtraction on most cores.
    """
    names = {raw.name: name for name, raw in short.items()}
    taken = {op.arguments[1] for op in body if op.function == "mul_add_short"}
    found = {op.result.name for op in body if op.result.name in short}
    differences = [op.arguments for op in body if op.function == "sub" and all(a in names for a in op.arguments)]
    found.update(names[str(a)] for pair in differences if len(taken.intersection(pair)) == 1 for a in pair)
    return frozenset(found)


def one_by_one(
    summing: Summing,
    products: Sequence[tuple[Part, int]],
    whole: Sequence[Part],
    constant: Fraction,
    q: int,
    wish: Wish,
) -> Term:
    """Return a sum of products, each with its shift to the left; what is subtracted as it is comes last."""
    added, taken = ([p for p in whole if (p[0] > 0) == plus] for plus in (True, False))
    ops = summing.ops
    total = summing.plain(added, constant, q, ("", "")) if added or constant else None
    for n, ((weight, term), left) in enumerate(products, 1):
        own = wish if n == len(products) and not taken else ("", "")
        short = short_factor(summing, weight, term, q)
        if short is not None:
            raw, factor, error = short
            ops.wish = own
            before = error if total is None else total.error + error
            total = ops.emit("mul_add_short", (0 if total is None else total, raw, factor), number(q), before)
            continue
        a, factor, error = factor_of(summing, weight, term, left, q + HIGH)
        error += summing.rounding.error * 2.0**-q
        ops.wish = own
        if total is None:
            total = ops.emit("mul_shift", (a, factor, HIGH), number(q), error)
        else:
            total = ops.emit("mul_add", (total, a, factor), number(q), total.error + error)
    assert total is not None
    for n, (_, term) in enumerate(taken, 1):
        a = summing.widened(term, q)
        ops.wish = wish if n == len(taken) else ("", "")
        total = ops.emit("sub", (total, a), number(q), total.error + a.error)
    return total
