"""Read off a plant what the classical tuning rules ask for: its reaction curve and its ultimate point.

Reaction curve: the tangent at the steepest point of the answer y(t) to a unit step, of slope R, meets the line y = 0
after the delay L (Ziegler and Nichols, Trans. ASME 64 (1942) 759-768); T63 is the time to 63.2 % of the final value
K, so that K exp(-L s)/((T63 - L) s + 1) is the three-parameter model of Astrom and Hagglund (Advanced PID Control,
2006, section 2.7). For a plant that integrates, R is the final slope and there is neither K nor T63.

Ultimate point: where the phase of the sampled plant first reaches -180 deg; a proportional controller of gain Ku =
1/|P| makes the loop swing there for ever, with period Tu (same source).

Both see the plant as the controller does: behind the hold. It delays a reaction curve by half a period.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.discretize.zero_order_hold import zero_order_hold
from firmloop.design.law import DesignError
from firmloop.design.models.process import BY_HAND, process, zero_pole
from firmloop.identify.simulation.linearize import Linear

Array = npt.NDArray[np.float64]
Response = npt.NDArray[np.complex128]

TIMES = 100  # of the first look at a reaction curve, spread over the logarithm of time
FREQUENCIES = 2000  # of the first look for the ultimate point


@dataclass(frozen=True, slots=True)
class Reaction:
    """The answer to a unit step; `gain` and `lag` are NaN where the plant integrates."""

    gain: float  # K, y/u
    slope: float  # R, y/(u s)
    delay: float  # L, s, half a sample of hold included
    lag: float  # T63 - L, s

    @property
    def integrates(self) -> bool:
        """Whether the answer never ends."""
        return math.isnan(self.gain)


@dataclass(frozen=True, slots=True)
class Ultimate:
    """Where the loop of a proportional controller swings for ever; `gain` carries the sign of the plant's."""

    gain: float  # Ku, u/y
    period: float  # Tu, s


def reaction(linear: Linear, period: float) -> Reaction:
    """Find the reaction curve of the plant behind a hold of `period` s.

    Raises
    ------
    DesignError
        when the plant is unstable, rings, has no gain at rest or integrates twice.

    A plant without a state has no slope: it is all there at once, in the sample after.
    """
    model = process(zero_pole(linear), period)  # refuses what no such rule was made for
    hold = linear.delay + period / 2
    if model.integrators > 1:
        raise DesignError(f"the plant integrates twice, so that it has no reaction curve; {BY_HAND}")
    if model.integrators:
        return Reaction(math.nan, model.gain, model.delay + sum(model.lags), math.nan)
    gain = model_gain(linear)
    if not len(linear.a):
        return Reaction(gain, math.copysign(math.inf, gain), linear.delay + period, 0.0)
    curve = _Curve(linear)
    sign = math.copysign(1.0, gain)
    times = np.geomspace(1e-4 * curve.fastest, 20 * curve.slowest, TIMES)
    slopes = [sign * curve.at(t)[1] for t in times]
    k = int(np.argmax(slopes))
    steepest = scipy.optimize.minimize_scalar(
        lambda t: -sign * curve.at(t)[1],
        bounds=(times[max(k - 1, 0)] if k else 0.0, times[min(k + 1, TIMES - 1)]),
        method="bounded",
    )
    moment = float(steepest.x)
    value, slope = curve.at(moment)
    begin, first = curve.at(0.0)
    if sign * first >= sign * slope * (1 - 1e-6):  # steepest at once, as a single lag is
        moment, value, slope = 0.0, begin, first
    reached = scipy.optimize.brentq(
        lambda t: curve.at(t)[0] / gain - (1 - math.exp(-1)), 0.0, 40 * curve.slowest, xtol=1e-12 * curve.slowest
    )
    intercept = max(moment - value / slope, 0.0)
    return Reaction(gain, slope, intercept + hold, max(float(reached) - intercept, 0.0))


def ultimate(linear: Linear, period: float) -> Ultimate:
    """Find the ultimate point of the plant sampled every `period` s.

    Raises
    ------
    DesignError
        when its phase never reaches -180 deg.
    """
    process(zero_pole(linear), period)
    response = sampled_response(linear, period)
    top = math.pi / period
    speeds = np.abs(np.linalg.eigvals(np.atleast_2d(linear.a)))
    bottom = 1e-3 * min(speeds[speeds > 1e-9 * top].min(initial=top), top)
    grid = np.geomspace(bottom, top, FREQUENCIES)
    values = response(grid)
    sign = math.copysign(1.0, model_gain(linear))
    phase = np.unwrap(np.angle(sign * values))
    beyond = np.flatnonzero(phase <= -math.pi * (1 - 1e-9))
    if not len(beyond):
        raise DesignError(
            "the plant's phase never reaches -180 deg below half the sampling rate, so that it has no ultimate gain; "
            'use another rule, such as tune = "simc"'
        )
    k = int(beyond[0])
    crossing = float(grid[k])
    if 0 < k < len(grid) - 1 and phase[k] < -math.pi:
        crossing = float(
            scipy.optimize.brentq(
                lambda w: np.angle(-sign * response(np.array([w]))[0]), grid[k - 1], grid[k], xtol=1e-12 * grid[k]
            )
        )
    size = abs(response(np.array([crossing]))[0])
    return Ultimate(sign / float(size), 2 * math.pi / crossing)


def sampled_response(linear: Linear, period: float) -> Callable[[Array], Response]:
    """Return w (n,) in rad/s -> P(exp(j w h)) (n,) of the first input's way to the first output."""
    sampled = zero_order_hold(linear, period)
    b_now, b_before, c, d = sampled.b_now[:, 0], sampled.b_before[:, 0], sampled.c[0], float(sampled.d[0, 0])

    def response(frequency: Array) -> Response:
        z = np.exp(1j * frequency * period)
        inner = d / z
        if len(sampled.a):
            matrix = z[:, None, None] * np.eye(len(sampled.a)) - sampled.a
            inner = inner + np.linalg.solve(matrix, (b_now + b_before / z[:, None])[:, :, None])[:, :, 0] @ c
        return np.asarray(inner * z ** (-sampled.whole), dtype=np.complex128)

    return response


def model_gain(linear: Linear) -> float:
    """Gain at rest, or of its integrators where it has some."""
    plant = zero_pole(linear)
    scale = max(np.abs(plant.poles), default=0.0)
    poles = plant.poles[np.abs(plant.poles) > 1e-9 * scale]
    return plant.factor * float(np.real(np.prod(-plant.zeros) / np.prod(-poles)))


class _Curve:
    """y(t) and its slope after a unit step, exact at any time: one matrix exponential each."""

    def __init__(self, linear: Linear) -> None:
        a, b = np.atleast_2d(linear.a), np.atleast_2d(linear.b)[:, :1]
        order = len(a)
        self._a, self._b, self._c, self._d = (
            a,
            b[:, 0],
            np.atleast_2d(linear.c)[0],
            float(np.atleast_2d(linear.d)[0, 0]),
        )
        self._block = np.zeros((order + 1, order + 1))
        self._block[:order, :order], self._block[:order, order:] = a, b
        speeds = np.abs(np.linalg.eigvals(a).real) if order else np.ones(1)
        self.slowest, self.fastest = float(1 / speeds.min()), float(1 / speeds.max())

    def at(self, time: float) -> tuple[float, float]:
        """Value and slope at `time` in s."""
        x = scipy.linalg.expm(self._block * time)[:-1, -1]
        return float(self._c @ x + self._d), float(self._c @ (self._a @ x + self._b))
