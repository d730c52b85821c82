"""Bound what a stable linear recursion makes of bounded inputs: sums of |impulse responses|, in whole numbers.

The responses are followed for a number of samples; a quadratic Lyapunov function bounds what comes after them, and what
rounding of the rows has done. With A' P A <= r^2 P, |v A^k b| <= r^k sqrt(v P^-1 v') sqrt(b' P b).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.forever.ring import Line, Ring
from firmloop.verify.proofs.forever.sampled import inverted, matrix_product
from firmloop.verify.proofs.forever.slopes import root
from firmloop.verify.proofs.forever.stated import Matrix

PLACES = 128  # binary places of the rows
MOST_STEPS = 400_000
Whole = NDArray[Any]


@dataclass(frozen=True, slots=True)
class ResponseSums:
    """Bounds of the sums of |responses|: `of[j][name]` is how far line j moves for each unit of the input `name`."""

    of: Sequence[Mapping[str, Fraction]]


def check_lyapunov(matrix: Sequence[Sequence[Fraction]], p: Matrix, rate: Fraction) -> None:
    """Assert that P and r^2 P - A' P A are positive definite, by the signs of their leading minors (Sylvester).

    Raises
    ------
    ProofError
        when one of them is not.
    """
    if any(p[i][j] != p[j][i] for i in range(len(p)) for j in range(i)):
        raise ProofError("the Lyapunov matrix is not symmetric")
    if not positive_definite(p):
        raise ProofError("the Lyapunov matrix is not positive definite")
    turned = list(zip(*matrix, strict=True))
    after = matrix_product(matrix_product(turned, p), matrix)
    left = [[rate * rate * a - b for a, b in zip(row, other, strict=True)] for row, other in zip(p, after, strict=True)]
    if not positive_definite(left):
        raise ProofError(f"the Lyapunov function does not fall by {float(rate):.9g} in a sample of the closed loop")


def positive_definite(matrix: Sequence[Sequence[Fraction]]) -> bool:
    """Tell whether a symmetric matrix is, exactly (Bareiss, Math. Comp. 22 (1968) 565)."""
    common = lcm(*(entry.denominator for row in matrix for entry in row))
    rows = [[entry.numerator * (common // entry.denominator) for entry in row] for row in matrix]
    before = 1
    for k in range(len(rows)):
        lead = rows[k][k]
        if lead <= 0:
            return False
        for i in range(k + 1, len(rows)):
            for j in range(k + 1, len(rows)):
                rows[i][j] = (rows[i][j] * lead - rows[i][k] * rows[k][j]) // before
        before = lead
    return True


def gains(
    ring: Ring, lines: Sequence[Line], names: Sequence[str], p: Matrix, rate: Fraction, steps: int
) -> ResponseSums:
    """Bound the sums for every line and input; `check_lyapunov` has passed.

    Raises
    ------
    ProofError
        when so many samples are not followed.
    """
    if not 0 < steps <= MOST_STEPS:
        raise ProofError(f"{steps} samples are not followed; at most {MOST_STEPS} are")
    matrix, matrix_places = _whole(ring.matrix)
    table, table_places = _whole([[ring.columns[name][k] for name in names] for k in range(len(ring.matrix))])
    one = 1 << PLACES
    rows = np.array([[round(entry * one) for entry in line.vector] for line in lines], dtype=object)
    sums = np.zeros((len(lines), len(names)), dtype=object)
    for _ in range(steps):
        sums += np.abs(rows @ table)
        rows = (rows @ matrix) >> matrix_places
    off = _beyond(rows, ring, names, p, rate, steps)
    scale = one << table_places
    return ResponseSums(
        [
            {
                name: Fraction(int(sums[j, k]), scale) + off[j][k] + abs(line.direct.get(name, Fraction(0)))
                for k, name in enumerate(names)
            }
            for j, line in enumerate(lines)
        ]
    )


def _beyond(
    rows: Whole, ring: Ring, names: Sequence[str], p: Matrix, rate: Fraction, steps: int
) -> list[list[Fraction]]:
    """Return what the samples that are not followed add, and the roundings of those that are.

    A row is rounded by less than one unit in each entry and sample, the first one included. What a rounding does later
    is bounded by 1 / (1 - rate) of its norm; there are steps + 1 of them.
    """
    size = len(p)
    back = inverted(p)
    norms = [
        root(
            sum(
                (
                    ring.columns[n][i] * p[i][j] * ring.columns[n][j]
                    for i in range(size)
                    for j in range(size)
                    if ring.columns[n][i] and ring.columns[n][j]
                ),
                Fraction(0),
            )
        )
        for n in names
    ]
    rounding = root(sum((abs(entry) for row in back for entry in row), Fraction(0))) / (1 << PLACES)
    found = []
    for row in rows:
        exact = [Fraction(int(entry), 1 << PLACES) for entry in row]
        norm = root(
            sum((a * back[i][j] * b for i, a in enumerate(exact) for j, b in enumerate(exact) if a and b), Fraction(0))
        )
        total = (norm + (steps + 1) * rounding) / (1 - rate)
        found.append([total * column for column in norms])
    return found


def _whole(matrix: Sequence[Sequence[Fraction]]) -> tuple[Whole, int]:
    """Return entries as whole numbers over a common power of two; every number of a loop is such a fraction."""
    places = max((entry.denominator.bit_length() - 1 for row in matrix for entry in row), default=0)
    assert all((1 << places) % entry.denominator == 0 for row in matrix for entry in row), "a fraction of another kind"
    scaled = [[entry.numerator * ((1 << places) // entry.denominator) for entry in row] for row in matrix]
    return np.array(scaled, dtype=object).reshape(len(matrix), -1), places
