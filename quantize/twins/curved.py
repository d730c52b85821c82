"""Sine, square root and reciprocal in whole numbers, the twins of those in `fl_curved_i32.h`, bit for bit.

An angle is a share of a whole turn, 2**32, so that it wraps by itself; mirrored into the quarters beside 0 its sine is
a polynomial of order 11 (Hart and others, Computer Approximations, 1968, chapter 6). The root comes from its
reciprocal, a polynomial of order 3 and two of Newton's steps y (3 - u y^2)/2, after the value has been brought to
1/4..1 by shifts. The reciprocal is one short division and one of Newton's steps y (2 - x y). `*_ERROR` bounds what
they are off.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.int64]
Interval = tuple[int, int]

SINE_PLACES = 30  # of the result: 1 is 2**30
SINE_ERROR = 2.5e-9
ONE = (1 << SINE_PLACES) + 8  # what a sine, rounded, does not pass
ROOT_ERROR = 2e-8  # relative, beside the unit that is rounded down
INVERSE_ROUNDING = 4  # units of the result
WORD = 1 << 31
# Of y, y**3, ..., y**11 in Q29, Q31, ..., Q39; the first is a unit more, for every product is rounded down.
_SINE = (843314857, -1387197326, 684554113, -160859250, 22020091, -1879182)
_ROOT = (104433954, -396673923, 836167627, -654565611)  # 1/sqrt(u) in Q25, Q26, Q27, Q28: of 1, u, u**2, u**3


def turn(a: Any, factor: int, s: int) -> Words:
    """Return an angle times `factor` over 2**s, a whole turn being 2**32, from -1/2 to 1/2."""
    found: Words = (((np.asarray(a) * factor >> s) + WORD) & (2 * WORD - 1)) - WORD
    return found


def turn_sine(x: Any) -> Words:
    """Return the sine of a share of a turn."""
    x = np.asarray(x)
    folded = (x >= WORD >> 1) | (x < -(WORD >> 1))
    y = np.where(folded, np.where(x >= 0, WORD - x, -WORD - x), x)  # within a quarter turn, 2**30
    z = y * y >> 30
    value: Words = np.asarray(_SINE[-1])
    for factor in _SINE[-2::-1]:
        value = factor + (z * value >> 32)
    found: Words = y * value >> 29
    return found


def turn_cosine(x: Any) -> Words:
    """Return the cosine of a share of a turn."""
    return turn_sine(((np.asarray(x) + (WORD >> 1) + WORD) & (2 * WORD - 1)) - WORD)


def whole_root(a: Any, s: int) -> Words:
    """Return sqrt(a 2**s), rounded down, for a from 0 and an odd s from 1 to 31."""
    m = np.asarray(a).astype(np.int64)
    k = np.zeros_like(m)
    for places in (16, 8, 4, 2):
        small = m < WORD >> places
        m = np.where(small, m << places, m)
        k = np.where(small, k + places // 2, k)
    y: Words = np.asarray(_ROOT[-1])
    for factor in _ROOT[-2::-1]:
        y = factor + (m * y >> 32)
    y = y << 5
    for _ in range(2):
        y = y * ((3 << 27) - (m * (y * y >> 32) >> 32)) >> 28
    found: Words = (m * y >> 30) >> (k + (31 - s) // 2)
    return found


def inverse(x: Any, k: int, j: int) -> Words:
    """Return about 2**(31 + k + j)/x for x above 0; x over 2**k has at most 16 bits and is at least 1."""
    x = np.asarray(x)
    short = (x + (1 << k >> 1)) >> k
    y = WORD // short
    left = (WORD << k) - x * y
    found: Words = (y << j) + (y * (left >> k) >> (31 - j))
    return found


def turn_bound(a: Interval, factor: int, s: int) -> Interval:
    """Bound what wraps: any word."""
    del a, factor, s
    return -WORD, WORD - 1


def sine_bound(a: Interval) -> Interval:
    """Bound a sine."""
    del a
    return -ONE, ONE


def root_bound(a: Interval, s: int) -> Interval:
    """Bound the root of a value from 0; below 0 there is none."""
    low, high = (math.isqrt(max(int(end), 0) << int(s)) for end in a)
    return max(low - _off(low), 0), high + _off(high)


def _off(found: int) -> int:
    return 2 + (found >> 25)


def inverse_error(x: Interval, k: int) -> float:
    """Bound the relative error: the square of that of the short division."""
    least, most = (int(end) + (1 << k >> 1) >> k for end in x)
    rounded = 0.5 / least if k else 0.0
    return (rounded + most / WORD) ** 2 * (1.0 + 1.0 / least)


def inverse_bound(x: Interval, k: int, j: int) -> Interval:
    """Bound the reciprocal of a value above 0."""
    share = inverse_error(x, int(k))
    high, low = ((WORD << (int(k) + int(j))) / int(end) for end in x)
    return math.floor(low * (1 - share)) - INVERSE_ROUNDING, math.ceil(high * (1 + share)) + INVERSE_ROUNDING
