"""Find the roots of a polynomial of rational coefficients to all places of a double.

Roots that crowd are moved far by the rounding of an ordinary solver: those of order n scatter by eps^(1/n). Aberth's
iteration (O. Aberth, Math. Comp. 27 (1973) 339-344) in whole numbers, with the variable scaled so that the largest root
is about 1 and BITS bits a root behind the point, has none of that.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt

Roots = npt.NDArray[np.complex128]
Point = tuple[int, int]  # real and imaginary part, in units of 2^-places

BITS = 64  # behind the point for each root: what n factors of the slope at a root may take away
SETTLED = 70  # bits of a root that the last step must leave alone
MOST_STEPS = 200
TURN = 0.01  # of a start's size, by which it leaves any symmetry: two real starts may have to become a pair
REAL = 1e-15  # of a root's size: less of an imaginary part is none


def exact_roots(coefficients: Sequence[Fraction], near: Roots) -> Roots:
    """Return the roots (n,) of coefficients (n + 1,) in falling powers, from the guess `near`; none of them is 0."""
    order = len(near)
    largest = max(abs(root) for root in near)
    scale = Fraction(2) ** math.ceil(math.log2(largest))
    places = BITS * (order + 2)
    monic = [_fixed(value / coefficients[0] / scale**k, places) for k, value in enumerate(coefficients)]
    guess = [root / float(scale) for root in near]
    points = [_point(root + TURN * abs(root) * cmath.exp(1j * k), places) for k, root in enumerate(guess)]
    for _ in range(MOST_STEPS):
        settled = True
        for k in range(order):
            step = _step(monic, points, k, places)
            points[k] = (points[k][0] - step[0], points[k][1] - step[1])
            settled &= max(map(abs, step)) <= max(map(abs, points[k])) >> SETTLED
        if settled:
            break
    found = [complex(*(float(Fraction(part, 1 << places)) for part in point)) for point in points]
    return _paired(np.array(found, dtype=np.complex128) * float(scale))


def _step(monic: Sequence[int], points: Sequence[Point], k: int, places: int) -> Point:
    """Return p/p' / (1 - p/p' sum 1/(x_k - x_j))."""
    x, one = points[k], (1 << places, 0)
    value, slope = one, (0, 0)
    for coefficient in monic[1:]:
        sloped = _times(slope, x, places)
        slope = (sloped[0] + value[0], sloped[1] + value[1])
        valued = _times(value, x, places)
        value = (valued[0] + coefficient, valued[1])
    if value == (0, 0):
        return (0, 0)
    apart = [(x[0] - y[0], x[1] - y[1]) for j, y in enumerate(points) if j != k]
    pulls = [_over(one, gap, places) for gap in apart if gap != (0, 0)]
    newton = (sum(pull[0] for pull in pulls), sum(pull[1] for pull in pulls))
    back = _over(slope, value, places)
    return _over(one, (back[0] - newton[0], back[1] - newton[1]), places)


def _times(a: Point, b: Point, places: int) -> Point:
    return (a[0] * b[0] - a[1] * b[1]) >> places, (a[0] * b[1] + a[1] * b[0]) >> places


def _over(a: Point, b: Point, places: int) -> Point:
    size = b[0] * b[0] + b[1] * b[1]
    if size == 0:
        return (0, 0)
    return ((a[0] * b[0] + a[1] * b[1]) << places) // size, ((a[1] * b[0] - a[0] * b[1]) << places) // size


def _fixed(value: Fraction, places: int) -> int:
    return round(value * (1 << places))


def _point(value: complex, places: int) -> Point:
    return _fixed(Fraction(value.real), places), _fixed(Fraction(value.imag), places)


def _paired(roots: Roots) -> Roots:
    """Take the lower half of each pair as the mirror of the upper one."""
    real = np.abs(roots.imag) <= REAL * np.abs(roots)
    upper = roots[~real & (roots.imag > 0)]
    return np.concatenate([upper, upper.conj(), roots[real].real + 0j])
