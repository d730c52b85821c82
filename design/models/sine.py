"""A sine out of sums, products and magnitudes, so that every number format computes it to the last bit."""

from __future__ import annotations

import math

import casadi as ca

# sin(pi/2 x) on -1..1 to 1.1e-4: C. Hastings, Approximations for Digital Computers, Princeton 1955, sheet 14.
HASTINGS = (1.5706268, -0.6432292, 0.0727102)
WORST = 1.1e-4


def sine(angle: ca.SX, low: float, high: float) -> ca.SX:
    """Return sin(angle), `angle` in rad within low..high.

    In quarter turns from the top of the wave, y = |angle/(pi/2) - 1|, the wave is even about every even number: the
    fold c - |y - c| halves the range of y until it is 0..2, and 1 - y is then within -1..1. The limits change nothing,
    but tell fixed point the range.
    """
    y = ca.fabs(angle * (2 / math.pi) - 1)
    top = max(abs(low * 2 / math.pi - 1), abs(high * 2 / math.pi - 1))
    fold = 2.0
    while fold < top / 2:
        fold *= 2
    while fold >= 2 and top > 2:
        y = ca.fmin(ca.fabs(fold - ca.fabs(y - fold)), fold)
        fold /= 2
    x = ca.fmin(ca.fmax(1 - y, -1), 1)
    square = x * x
    a, b, c = HASTINGS
    return x * (a + square * (b + c * square))
