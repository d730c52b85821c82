r"""A discrete transfer function by its roots in delta = z - 1, and the ways to sample one given in s.

Roots are kept as delta, for where a fast controller's poles crowd z = 1 their distance from 1 is all that matters, and
z itself rounds it off. With h the period and s0 a root in s:

- tustin: s = c (z-1)/(z+1), c = 2/h: delta0 = 2 s0/(c - s0); zeros at infinity go to z = -1.
- prewarp: the same with c = w/tan(w h/2), so that the responses agree at w.
- backward: s = (z-1)/(z h): delta0 = s0 h/(1 - s0 h); zeros at infinity go to z = 0.
- matched: z = exp(s h): delta0 = expm1(s0 h); zeros at infinity are left out, the gain agrees as s -> 0.
- zoh: exact where the input is held between samples; poles as matched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.discretize.exact_roots import exact_roots
from firmloop.design.discretize.unit_circle import PRINTED, listed, written
from firmloop.design.law import DesignError

Array = npt.NDArray[np.float64]
Roots = npt.NDArray[np.complex128]

FAR = 1e3  # times better
DOUBTFUL = 1e-9  # of a root's size
OUTSIDE = 1e-6  # beyond the boundary, as a share of 1 or of a root in s: less is what several integrators scatter
TOLD = 0.1  # of a pole's distance from the boundary: coefficients that move it farther do not say what was meant
CROWDED = (
    "a polynomial of this order holds poles that crowd so badly that the last digit of its coefficients moves them by "
    "much of their distance from the boundary: give controller.sections instead, rows [b0, b1, b2, a0, a1, a2]"
)
METHODS = ("tustin", "zoh", "matched", "prewarp", "backward")


@dataclass(frozen=True, slots=True)
class Rational:
    """H(delta) = gain prod(delta - zeros) / prod(delta - poles), delta = z - 1; as many zeros as poles at most."""

    zeros: Roots
    poles: Roots
    gain: float


def from_z(numerator: Sequence[float], denominator: Sequence[float]) -> Rational:
    """Take coefficients in falling powers of z; delta = z - 1 is put in exactly."""
    above, below = _trimmed("numerator", numerator), _trimmed("denominator", denominator)
    if len(above) > len(below):
        raise DesignError(
            f"controller.numerator has order {len(above) - 1}, above the denominator's {len(below) - 1}: the output "
            "would need samples to come; give the denominator at least the numerator's order"
        )
    poles = _roots_of_z(below)
    moved = displacement(below, 1 + poles)
    excess = np.abs(1 + poles) - 1
    outside = [1 + pole for pole in poles[excess > _untold(moved)]]
    if outside:
        raise DesignError(
            f"controller.denominator is unstable: its poles at z = {listed(outside)} lie outside the unit circle; "
            f"correct the coefficients, or check domain and sample time{_advice(moved, np.abs(excess))}"
        )
    # Rounding alone has put it outside.
    held = np.where(excess > 0.0, (1 + poles) / np.maximum(np.abs(1 + poles), 1.0) - 1, poles)
    return _finite(Rational(_roots_of_z(above), held, _ratio(above, below)))


def from_s(
    numerator: Sequence[float], denominator: Sequence[float], period: float, method: str, prewarp: float
) -> Rational:
    """Sample a transfer function in falling powers of s every `period` s; `prewarp` in rad/s, used by that method."""
    above, below = _trimmed("numerator", numerator), _trimmed("denominator", denominator)
    if len(above) > len(below):
        raise DesignError(
            f"controller.numerator has order {len(above) - 1}, above the denominator's {len(below) - 1}: it would "
            "differentiate without a filter; add a pole far above the frequencies of interest"
        )
    zeros, poles, gain = _roots(above), _sharpened(_exact(below), _roots(below)), _ratio(above, below)
    size, moved = np.abs(poles), displacement(below, poles)
    outside = list(poles[poles.real > size * _untold(moved / np.where(size > 0.0, size, 1.0))])
    if outside:
        raise DesignError(
            f"controller.denominator is unstable: its poles at s = {_listed(outside)} rad/s lie right of the imaginary "
            f"axis; correct the coefficients{_advice(moved, np.abs(poles.real))}"
        )
    poles = np.where(poles.real > 0.0, 1j * poles.imag, poles)
    with np.errstate(all="ignore"):
        match method:
            case "tustin":
                found = _tustin(zeros, poles, gain, 2 / period)
            case "prewarp":
                found = _tustin(zeros, poles, gain, prewarp / math.tan(prewarp * period / 2))
            case "backward":
                found = _backward(zeros, poles, gain, period)
            case "matched":
                found = _matched(zeros, poles, gain, period)
            case _:
                found = _held(above, below, poles, period)
    return _finite(found)


def in_series(parts: Sequence[Rational]) -> Rational:
    """Multiply transfer functions, each with its own roots."""
    return Rational(
        np.concatenate([part.zeros for part in parts]),
        np.concatenate([part.poles for part in parts]),
        math.prod(part.gain for part in parts),
    )


def badly_held(denominator: Sequence[float], rational: Rational) -> bool:
    """Tell whether coefficients in z say too little of their poles, those on the circle (integrators) apart."""
    room = 1 - np.abs(1 + rational.poles)
    return bool(np.any((displacement(denominator, 1 + rational.poles) > TOLD * room) & (room > OUTSIDE)))


def displacement(coefficients: Sequence[float] | Array, roots: Roots) -> Array:
    """Return how far each root moves where the coefficients are rounded in their last place."""
    apart = np.abs(roots[:, None] - roots)
    np.fill_diagonal(apart, 1.0)
    with np.errstate(all="ignore"):
        noise = np.polyval(np.abs(coefficients), np.abs(roots)) * np.finfo(np.float64).eps
        moved = noise / (abs(coefficients[0]) * np.prod(apart, axis=1))
    return np.where(np.isnan(moved), np.inf, moved)


def response(rational: Rational, z: Roots) -> Roots:
    """Return H at points z (n,)."""
    delta = z[:, None] - 1
    return np.asarray(rational.gain * np.prod(delta - rational.zeros, axis=1) / np.prod(delta - rational.poles, axis=1))


def _tustin(zeros: Roots, poles: Roots, gain: float, c: float) -> Rational:
    missing = np.full(len(poles) - len(zeros), -2.0 + 0j)
    factor = gain * (np.prod(c - zeros) / np.prod(c - poles)).real
    return Rational(np.concatenate([2 * zeros / (c - zeros), missing]), 2 * poles / (c - poles), float(factor))


def _backward(zeros: Roots, poles: Roots, gain: float, h: float) -> Rational:
    missing = np.full(len(poles) - len(zeros), -1.0 + 0j)
    factor = gain * (np.prod((1 - zeros * h) / h) / np.prod((1 - poles * h) / h)).real
    return Rational(np.concatenate([zeros * h / (1 - zeros * h), missing]), poles * h / (1 - poles * h), float(factor))


def _matched(zeros: Roots, poles: Roots, gain: float, h: float) -> Rational:
    above, below = np.expm1(zeros * h), np.expm1(poles * h)
    slow = gain * (np.prod(-zeros[zeros != 0]) / np.prod(-poles[poles != 0])).real
    integrators = int(np.sum(poles == 0)) - int(np.sum(zeros == 0))
    factor = slow * h**integrators * (np.prod(-below[poles != 0]) / np.prod(-above[zeros != 0])).real
    return Rational(above, below, float(factor))


def _held(above: Array, below: Array, poles: Roots, h: float) -> Rational:
    """Sample the companion form with time in periods, which keeps its entries near 1."""
    order = len(below) - 1
    if order == 0:
        return Rational(np.zeros(0, np.complex128), poles, float(above[0] / below[0]))
    scale = h ** np.arange(order + 1)
    monic = (below / below[0] * scale)[1:]
    upper = np.concatenate([np.zeros(order + 1 - len(above)), above / below[0]]) * scale
    direct, c = upper[0], upper[1:] - upper[0] * monic
    block = np.zeros((order + 1, order + 1))
    block[0, :order], block[0, order] = -monic, 1.0
    block[1:order, : order - 1] = np.eye(order - 1)
    exponential = scipy.linalg.expm(block)
    a, b = exponential[:order, :order] - np.eye(order), exponential[:order, order:]
    numerator = np.poly(a - b @ c[None, :]) + (direct - 1) * np.poly(a)
    if direct == 0:
        numerator = numerator[1:]
    if numerator[0] == 0:
        raise DesignError(
            f"controller.numerator and denominator leave nothing but rounding when sampled every {h:g} s by zoh; "
            "sample faster, leave far faster poles out, or choose another discretize"
        )
    return Rational(_roots(numerator.real), np.expm1(poles * h), float(numerator[0].real))


def _trimmed(key: str, coefficients: Sequence[float]) -> Array:
    """Drop leading zeros; refuse nothing but zeros."""
    found = np.trim_zeros(np.asarray(coefficients, dtype=np.float64), "f")
    if not len(found):
        raise DesignError(
            f"controller.{key} = {list(coefficients)} is zero; give at least one coefficient other than 0"
        )
    return found


def _exact(coefficients: Array) -> list[Fraction]:
    return [Fraction(float(value)) for value in coefficients]


def _shifted(coefficients: Array) -> list[Fraction]:
    """Write a polynomial in z in powers of z - 1, exactly (Taylor shift by repeated synthetic division)."""
    exact = _exact(coefficients)
    for last in range(len(exact), 1, -1):
        for k in range(1, last):
            exact[k] += exact[k - 1]
    return exact


def _ratio(above: Array, below: Array) -> float:
    with np.errstate(all="ignore"):
        return float(above[0] / below[0])


def _roots_of_z(coefficients: Array) -> Roots:
    """Return the roots as delta, from powers of delta unless they are far better known from powers of z.

    Of a high order with roots all around the circle, such as z^30 - 0.5, powers of delta keep no places. Roots at z = 0
    are told by the last coefficients, and known exactly.
    """
    moving = np.trim_zeros(coefficients, "b")
    return np.concatenate([_moving_roots(moving), np.full(len(coefficients) - len(moving), -1.0 + 0j)])


def _moving_roots(coefficients: Array) -> Roots:
    exact = _shifted(coefficients)
    shifted = np.array([float(value) for value in exact])
    by_delta, by_z = _roots(shifted), _roots(coefficients)
    if FAR * _doubt(coefficients, by_z) < _doubt(shifted, by_delta):
        return by_z - 1
    return _sharpened(exact, by_delta)


def _error(coefficients: Array, roots: Roots) -> Array:
    """Return the share of its size by which each root may be off: what is left of p there over the slope of p."""
    with np.errstate(all="ignore"):
        noise = np.polyval(np.abs(coefficients), np.abs(roots)) * np.finfo(np.float64).eps
        left = np.maximum(np.abs(np.polyval(coefficients, roots)), noise) / noise
        share = displacement(coefficients, roots) * left / np.abs(roots)
    return np.where(np.isnan(share), np.inf, share)


def _sharpened(exact: list[Fraction], roots: Roots) -> Roots:
    """Find again, to all places, roots that an ordinary solver cannot know to more than DOUBTFUL of their size."""
    still = np.abs(roots) == 0
    moving, near = exact[: len(exact) - int(still.sum())], roots[~still]
    if not len(near) or np.all(_error(np.array([float(value) for value in moving]), near) <= DOUBTFUL):
        return roots
    return np.concatenate([exact_roots(moving, near), roots[still]])


def _doubt(coefficients: Array, roots: Roots) -> float:
    """Return how far the roots may be from those of the exact polynomial: what rounds in p over the slope of p."""
    with np.errstate(all="ignore"):
        noise = np.polyval(np.abs(coefficients), np.abs(roots)) * np.finfo(np.float64).eps
        return float(np.max(noise / np.abs(np.polyval(np.polyder(coefficients), roots)), initial=0.0))


def _roots(coefficients: Array) -> Roots:
    with np.errstate(all="ignore"):
        scaled = coefficients / coefficients[0]
    if not np.all(np.isfinite(scaled)):
        raise DesignError(
            f"the coefficients {coefficients[0]:g} and {np.max(np.abs(coefficients)):g} of controller.numerator or "
            "denominator are too far apart for their roots; scale them"
        )
    return np.roots(scaled).astype(np.complex128)


def _untold(moved: Array) -> Array:
    """Return how far beyond the boundary a root may lie, by what rounding moves it, before it is called unstable."""
    return np.minimum(OUTSIDE, np.maximum(PRINTED, 2 * moved))


def _advice(moved: Array, room: Array) -> str:
    """Say that coefficients cannot hold such roots, where their last place moves a root by much of its `room`."""
    return f"; {CROWDED}" if np.any(moved > TOLD * room) else ""


def _listed(roots: Sequence[np.complex128]) -> str:
    return ", ".join(map(written, roots[:4])) + (", ..." if len(roots) > 4 else "")


def _finite(rational: Rational) -> Rational:
    for part in (rational.zeros, rational.poles, np.array([rational.gain])):
        if not np.all(np.isfinite(part)):
            raise DesignError(
                "the sampled transfer function has infinite coefficients: a root of it meets the sample time; "
                "change controller.period_s, discretize or the coefficients"
            )
    return rational
