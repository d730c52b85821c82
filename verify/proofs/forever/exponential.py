"""Take matrix exponentials in whole numbers, with a bound on every rounding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

Whole = NDArray[Any]  # of Python's integers
Matrix = Sequence[Sequence[Fraction]]

PLACES = 256  # binary places of what is computed
TERMS = 40  # of a series whose terms fall by 16 and more: what is left out is far below the last place
_SMALL = 4  # the matrix is halved until its sums of rows are below 2**-_SMALL
LARGEST = 60  # halvings; a larger exponent is no sampled plant


@dataclass(frozen=True, slots=True)
class Near:
    """A matrix that no entry of `whole` * 2**-PLACES is farther from than `off` * 2**-PLACES."""

    whole: Whole
    off: int

    def times(self, other: Near) -> Near:
        """Return the product."""
        order = self.whole.shape[1]
        one, two = (int(np.max(np.abs(each.whole), initial=0)) for each in (self, other))
        off = order * (one * other.off + two * self.off + self.off * other.off)
        return Near((self.whole @ other.whole) >> PLACES, (off >> PLACES) + 2)

    def block(self, rows: slice, columns: slice) -> Near:
        """Return a part."""
        return Near(self.whole[rows, columns], self.off)

    def ends(self, row: int, column: int) -> tuple[Fraction, Fraction]:
        """Return the interval of one entry."""
        middle, scale = int(self.whole[row, column]), 1 << PLACES
        return Fraction(middle - self.off, scale), Fraction(middle + self.off, scale)


def exponential(matrix: Matrix) -> Near:
    """Return exp(matrix), by scaling, a series, and squaring (Higham, Functions of Matrices, 2008, ch. 10).

    Raises
    ------
    OverflowError
        when the matrix is far too large to be that of one sample.
    """
    order = len(matrix)
    norm = max((sum(abs(entry) for entry in row) for row in matrix), default=Fraction(0))
    halvings = max(0, ceil(norm).bit_length() + _SMALL)
    if halvings > LARGEST:
        raise OverflowError(f"the equations move {float(norm):.3g} times in a sample")
    scale = Fraction(1 << PLACES, 1 << halvings)
    whole = np.array([[int(entry * scale) for entry in row] for row in matrix], dtype=object).reshape(order, order)
    small = Near(whole, 1)
    unit = Near(np.array([[(i == j) << PLACES for j in range(order)] for i in range(order)], dtype=object), 0)
    total, term = unit, unit
    for k in range(1, TERMS + 1):
        product = term.times(small)
        term = Near(product.whole // k, product.off // k + 2)
        total = Near(total.whole + term.whole, total.off + term.off)
    total = Near(total.whole, total.off + 2)  # of all further terms
    for _ in range(halvings):
        total = total.times(total)
    return total


def with_slope(matrix: Matrix, direction: Matrix) -> tuple[Near, Near]:
    """Return exp(matrix) and its slope along `direction`, from one exponential of twice the order (same source)."""
    order = len(matrix)
    nothing = [Fraction(0)] * order
    above = [[*row, *turn] for row, turn in zip(matrix, direction, strict=True)]
    below = [[*nothing, *row] for row in matrix]
    both = exponential([*above, *below])
    return both.block(slice(order), slice(order)), both.block(slice(order), slice(order, 2 * order))
