"""Tell exactly whether the poles of a matrix lie within a circle around z = 0.

Eigenvalues of a cascade scatter: eight poles within 0.007 of z = 1 are off by 0.01, and a stable filter looks unstable.
So the matrix is first cut into the blocks that feed back upon themselves (a section of a cascade is one of them), which
have all its poles. Where a block's eigenvalues, with what rounding may do to them (F. L. Bauer and C. T. Fike, Numer.
Math. 2 (1960) 137-141), do not decide, its characteristic polynomial does, in whole numbers: Faddeev and LeVerrier's
method, z = (1 + s)/(1 - s), and Routh's array.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import zip_longest

import numpy as np
import numpy.typing as npt
import scipy.sparse.csgraph

Array = npt.NDArray[np.float64]

SEEN = 1e-4  # beyond the circle: less is not seen in the six digits of a pole
PLAIN = 2  # order up to which nothing is cheaper than to be exact
PRINTED = 1e-12  # beyond the circle: a pole by itself is told by coefficients to as many digits as anybody prints
MOST_EXACT = 24  # order of a block that takes a second; above it, eigenvalues have to do


def within(a: Array, radius: float) -> bool:
    """Tell whether every pole of `a` (n, n) is nearer to 0 than `radius`."""
    return all(_block_within(block, radius) for block in blocks(a))


def unstable(a: Array, scatter: float) -> bool:
    """Tell whether a pole of `a` lies farther outside the unit circle than coefficients may leave one that is on it.

    That is `scatter` where several poles meet, and for others what rounding does to them.
    """
    return not all(_block_within(block, 1.0 + min(scatter, max(PRINTED, _doubt(block)))) for block in blocks(a))


def written(root: complex) -> str:
    """Print a root in six digits."""
    return f"{root.real:.6g}" if root.imag == 0 else f"{root.real:.6g}{root.imag:+.6g}j"


def listed(outside: Sequence[complex]) -> str:
    """Print the first poles in z, with the distance from the circle where their own digits do not show it."""
    texts = []
    for pole in outside[:4]:
        beyond = abs(pole) - 1.0
        texts.append(written(pole) + (f" (|z| = 1 + {beyond:.2g})" if 0.0 < beyond < SEEN else ""))
    return ", ".join(texts) + (", ..." if len(outside) > 4 else "")


def poles(a: Array) -> npt.NDArray[np.complex128]:
    """Return the poles of `a`, block by block, farthest from the origin first."""
    parts = [np.linalg.eigvals(block) for block in blocks(a)]
    found = np.concatenate(parts).astype(np.complex128) if parts else np.zeros(0, np.complex128)
    return np.asarray(found[np.argsort(-np.abs(found), kind="stable")])


def blocks(a: Array) -> list[Array]:
    """Return the square blocks on the diagonal of `a`, ordered so that it is triangular but for them."""
    if not len(a):
        return []
    count, labels = scipy.sparse.csgraph.connected_components(a != 0, directed=True, connection="strong")
    return [a[np.ix_(labels == k, labels == k)] for k in range(count)]


def _block_within(block: Array, radius: float) -> bool:
    order = len(block)
    if order > MOST_EXACT:
        return float(np.max(np.abs(np.linalg.eigvals(block)))) < radius
    if order > PLAIN:
        values, vectors = np.linalg.eig(block)
        size = float(np.max(np.abs(values)))
        doubt = _scattered(block, vectors)
        if size + doubt < radius:
            return True
        if size - 2 * order * doubt > radius:
            return False
    return _hurwitz(_left_half(_characteristic(block, Fraction(radius))))


def _doubt(block: Array) -> float:
    return _scattered(block, np.linalg.eig(block)[1]) if len(block) > 1 else 0.0


def _scattered(block: Array, vectors: npt.NDArray[np.inexact]) -> float:
    """Return how far rounding may carry an eigenvalue."""
    return len(block) * np.finfo(np.float64).eps * float(np.linalg.norm(block)) * float(np.linalg.cond(vectors))


def _characteristic(block: Array, radius: Fraction) -> list[int]:
    """Return whole multiples of the coefficients of det(radius w I - block) in falling powers of w."""
    exact = [[Fraction(float(value)) for value in row] for row in block]
    unit = max(value.denominator for row in exact for value in row)  # a power of two, as all of them are
    whole = np.array([[int(value * unit) for value in row] for row in exact], dtype=object)
    order = len(block)
    identity = np.array([[int(j == k) for j in range(order)] for k in range(order)], dtype=object)
    found, power = [1], identity
    for k in range(1, order + 1):
        product = whole @ power
        found.append(-int(product.trace()) // k)
        power = product + found[-1] * identity
    scale = radius * unit
    return [value * scale.numerator ** (order - k) * scale.denominator**k for k, value in enumerate(found)]


def _left_half(inside: list[int]) -> list[int]:
    """Put w = (1 + s)/(1 - s): roots within the unit circle become roots in the left half plane."""
    order = len(inside) - 1
    total = [0] * (order + 1)
    for k, value in enumerate(inside):
        product = [value]
        for sign in [1] * (order - k) + [-1] * k:  # times 1 + s or 1 - s, falling powers
            product = [sign * x + y for x, y in zip([*product, 0], [0, *product], strict=True)]
        total = [x + y for x, y in zip(total, product, strict=True)]
    return total


def _hurwitz(coefficients: list[int]) -> bool:
    """Run down Routh's array: every row must begin with the sign of the first; rows keep no common factor."""
    upper, lower = coefficients[::2], coefficients[1::2]
    while lower:
        if upper[0] * lower[0] <= 0:
            return False
        below = [lower[0] * x - upper[0] * y for x, y in zip_longest(upper[1:], lower[1:], fillvalue=0)]
        common = math.gcd(*below) or 1
        sign = 1 if lower[0] > 0 else -1
        upper, lower = lower, [sign * x // common for x in below]
    return upper[0] != 0
