"""Sample a linear plant with delay behind a zero-order hold, exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.law import DesignError
from firmloop.identify.simulation.linearize import Linear

Array = npt.NDArray[np.float64]

MOST_DELAY = 300  # samples, each a state of the loop: ten within the delay are plenty for a controller


@dataclass(frozen=True, slots=True)
class Sampled:
    """A plant seen at the samples, the input held in between; k counts samples of `period`.

    x[k+1] = a x[k] + b_now u[k-whole] + b_before u[k-whole-1],    y[k] = c x[k] + d u[k-whole-1]

    y[k] is read just before u[k] acts, so that d meets the input of the sample before.
    """

    a: Array  # (n, n)
    b_now: Array  # (n, m)
    b_before: Array  # (n, m)
    c: Array  # (r, n)
    d: Array  # (r, m)
    whole: int  # whole samples of delay
    period: float  # s


def zero_order_hold(linear: Linear, period: float) -> Sampled:
    """Sample `linear` every `period` s; the delay is split into whole samples and a rest.

    With the delay (whole + rest) h, 0 <= rest < 1, the input changes once between two samples (Astrom and Wittenmark,
    Computer-Controlled Systems, 3rd ed., section 2.3)::

        b_now = int_0^(h - rest h) exp(A s) ds B        b_before = exp(A (h - rest h)) int_0^(rest h) exp(A s) ds B
    """
    if linear.delay < 0:
        raise DesignError(f"the plant's delay is {linear.delay:g} s; it must not be negative")
    whole = math.floor(linear.delay / period * (1 + 1e-12))  # 0.003 / 0.001 is three samples, not 2.9999
    if whole > MOST_DELAY:
        raise DesignError(
            f"the plant's delay of {linear.delay:g} s is {whole} samples of controller.period_s = {period:g}, and no "
            f"loop answers within it: a period of {linear.delay / 20:.2g} s does, {linear.delay / MOST_DELAY:.2g} s is "
            f"the least that is designed for"
        )
    rest = min(max(linear.delay - whole * period, 0.0), period)
    if rest < 1e-9 * period:
        rest = 0.0
    a, b = np.atleast_2d(linear.a), np.atleast_2d(linear.b)
    later, b_now = _held(a, b, period - rest)
    earlier, b_first = _held(a, b, rest)
    return Sampled(
        a=later @ earlier,
        b_now=b_now,
        b_before=later @ b_first,
        c=np.atleast_2d(linear.c),
        d=np.atleast_2d(linear.d),
        whole=whole,
        period=period,
    )


def state_space(sampled: Sampled) -> tuple[Array, Array, Array]:
    """Write the plant as (a, b, c): x[k+1] = a x[k] + b u[k], y[k] = c x[k].

    Past inputs, newest first, follow the plant's state.
    """
    order, inputs = sampled.b_now.shape
    kept = sampled.whole + (1 if np.any(sampled.b_before) or np.any(sampled.d) else 0)
    size = order + kept * inputs
    a, b = np.zeros((size, size)), np.zeros((size, inputs))
    c = np.zeros((sampled.c.shape[0], size))
    a[:order, :order] = sampled.a
    c[:, :order] = sampled.c

    def past(age: int) -> slice:
        return slice(order + (age - 1) * inputs, order + age * inputs)

    if sampled.whole == 0:
        b[:order] = sampled.b_now
    else:
        a[:order, past(sampled.whole)] = sampled.b_now
    if kept > sampled.whole:
        a[:order, past(kept)] = sampled.b_before
        c[:, past(kept)] = sampled.d
    if kept:
        b[past(1)] = np.eye(inputs)
    for age in range(2, kept + 1):
        a[past(age), past(age - 1)] = np.eye(inputs)
    return a, b, c


def _held(a: Array, b: Array, time: float) -> tuple[Array, Array]:
    """Return exp(A time) and int_0^time exp(A s) ds B, by one exponential (Van Loan, IEEE Trans. AC 23 (1978) 395)."""
    order, inputs = b.shape
    block = np.zeros((order + inputs, order + inputs))
    block[:order, :order] = a
    block[:order, order:] = b
    exponential = scipy.linalg.expm(block * time)
    return exponential[:order, :order], exponential[:order, order:]
