"""Elementary functions from + - * / alone, the twins of those in `fl_float.h`: the same bits on every machine.

An angle is brought within pi/4 of a multiple k of pi/2, an exponent within log(2)/2 of a multiple of log(2); the
multiple is subtracted in parts whose products with k are exact (Cody and Waite, Software Manual for the Elementary
Functions, 1980). What is left goes through a Taylor polynomial, long enough that less than half a unit in the last
place is left out. Rounding to the nearest whole number is done by adding and subtracting 1.5 * 2**(mantissa bits).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Raw = NDArray[Any]
Interval = tuple[float, float]

BEYOND_ONE = 1.000001  # what a sine, rounded, cannot reach
SIN_ERROR = 8.0  # units of rounding: of sine and cosine, beside one for each radian of the angle
EXP_ERROR = 16.0  # the same relative to the result, beside one for each unit of the exponent


@dataclass(frozen=True, slots=True)
class _Constants:
    """What the functions take in one floating-point format, as `fl_float.h` has it."""

    round: float  # added and subtracted: the nearest whole number
    turn: tuple[float, float, float]  # pi/2 in parts
    growth: tuple[float, float]  # log(2) in parts
    sine: tuple[float, ...]  # of r**3, r**5, ...
    cosine: tuple[float, ...]  # of r**2, r**4, ...
    power: tuple[float, ...]  # of r**2, r**3, ...
    least: float  # smallest exponent
    most: float
    flat: float  # where the hyperbolic tangent is 1
    bias: int
    mantissa: int


def _taylor(first: int, step: int, count: int, sign: int) -> tuple[float, ...]:
    return tuple(sign ** (k + 1) / math.factorial(first + k * step) for k in range(count))


CONSTANTS = {
    "f4": _Constants(
        12582912.0,
        (1.5703125, 4.837512969970703e-4, 7.549789954891882e-8),
        (0.693115234375, 3.1946184945309415e-5),
        _taylor(3, 2, 4, -1),
        _taylor(2, 2, 4, -1),
        _taylor(2, 1, 6, 1),
        -87.0,
        88.0,
        10.0,
        127,
        23,
    ),
    "f8": _Constants(
        6755399441055744.0,
        (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
        (0.6931471805592082, 7.371002565167799e-13),
        _taylor(3, 2, 8, -1),
        _taylor(2, 2, 8, -1),
        _taylor(2, 1, 12, 1),
        -708.0,
        709.0,
        20.0,
        1023,
        52,
    ),
}


def _constants(x: Raw) -> _Constants:
    return CONSTANTS[x.dtype.str[1:]]


def _wave(x: Any, ahead: int) -> Raw:
    """Return the sine of x + ahead pi/2."""
    x = np.asarray(x)
    own, kind = _constants(x), x.dtype.type
    with np.errstate(all="ignore"):
        nearest = np.asarray(x * kind(2.0 / math.pi) + kind(own.round))
        k = nearest - kind(own.round)
        r = ((x - k * kind(own.turn[0])) - k * kind(own.turn[1])) - k * kind(own.turn[2])
        quarter = nearest.view(f"i{x.dtype.itemsize}") + ahead  # in its last two bits
        z = r * r
        even, odd = kind(own.sine[-1]), kind(own.cosine[-1])
        for factor in own.sine[-2::-1]:
            even = even * z + kind(factor)
        for factor in own.cosine[-2::-1]:
            odd = odd * z + kind(factor)
        even = r + r * (z * even)
        odd = _from_one(z * odd)
        value = np.where(quarter & 1, odd, even)
        signed: Raw = np.where(quarter & 2, -value, value)
        return signed


def _from_one(x: Raw) -> Raw:
    """Return 1 + x for x from -2 to 0.

    Of doubles in two steps: GNU's library for Cortex-M3, M4 and M7 (libgcc 12.2) puts half of all 1 - x with x from
    2**-33 to 2**-32 one unit in the last place off.
    """
    kind = x.dtype.type
    whole: Raw = kind(1) + x if x.dtype.itemsize == 4 else (kind(0.75) + x) + kind(0.25)
    return whole


def sine(x: Any) -> Raw:
    """Return the sine of an angle in rad."""
    return _wave(x, 0)


def cosine(x: Any) -> Raw:
    """Return the cosine of an angle in rad."""
    return _wave(x, 1)


def exponential(x: Any) -> Raw:
    """Return e**x; x is limited to what has a normal result, and no number counts as the least."""
    x = np.asarray(x)
    own, kind = _constants(x), x.dtype.type
    with np.errstate(all="ignore"):
        x = np.where(x >= kind(own.least), np.where(x > kind(own.most), kind(own.most), x), kind(own.least))
        k = (x * kind(1.0 / math.log(2.0)) + kind(own.round)) - kind(own.round)
        r = (x - k * kind(own.growth[0])) - k * kind(own.growth[1])
        rest = kind(own.power[-1])
        for factor in own.power[-2::-1]:
            rest = rest * r + kind(factor)
        word = (k.astype(f"i{x.dtype.itemsize}") + own.bias) << own.mantissa
        whole: Raw = (kind(1) + (r + r * (r * rest))) * word.view(x.dtype)
        return whole


def hyperbolic_tangent(x: Any) -> Raw:
    """Return 1 - 2/(e**(2x) + 1); no number counts as far below zero."""
    x = np.asarray(x)
    own, kind = _constants(x), x.dtype.type
    with np.errstate(all="ignore"):
        x = np.where(x >= kind(-own.flat), np.where(x > kind(own.flat), kind(own.flat), x), kind(-own.flat))
        value = _from_one(-(kind(2) / (exponential(x + x) + kind(1))))
        return value


def quotient(a: Any, b: Any) -> Any:
    """Return a / b, infinite or no number where b is zero."""
    with np.errstate(all="ignore"):
        return a / b


def quotient_bound(a: Interval, b: Interval) -> Interval:
    """Bound a / b; without limits where b can be zero."""
    if b[0] <= 0 <= b[1] or not all(map(math.isfinite, (*a, *b))):
        return -math.inf, math.inf
    corners = [x / y for x in a for y in b]
    return min(corners), max(corners)


def exponential_bound(a: Interval) -> Interval:
    """Bound e**x; what limits the exponent lies within that of float64."""
    low, high = (math.exp(min(max(x, -87.0), 709.0)) for x in a)
    return low * (1 - 1e-6) if a[0] > -87.0 else 0.0, high * (1 + 1e-6)
