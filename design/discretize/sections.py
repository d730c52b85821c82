"""Split a discrete transfer function into second-order sections, each in the form that its poles ask for.

Two forms, both transposed direct form II, input e and output y of a section::

    shift  y = b0 e + w1    w1+ = b1 e - a1 y + w2         w2+ = b2 e - a2 y
    delta  y = b0 e + w1    w1+ = w1 + b1 e - a1 y + w2    w2+ = w2 + b2 e - a2 y

with (b0 z^2 + b1 z + b2)/(z^2 + a1 z + a2), for delta in powers of z - 1 (Middleton and Goodwin, Improved finite word
length characteristics in digital control using delta operators, IEEE Trans. AC 31 (1986) 1015). `form = "auto"` takes
delta where every pole of the section is nearer to z = 1 than NEAR: there a1 -> -2 and a2 -> 1 say little in their
leading bits, and a rounding of them moves the poles by more than NEAR's inverse times as far, relatively, as one of
the delta form's coefficients does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from firmloop.design.discretize.rational import Rational, Roots

Array = npt.NDArray[np.float64]

NEAR = 0.125
SMALL = 2.0**-24  # a factor below it leaves less than a byte of a 32-bit word
FORMS = ("auto", "shift", "delta")


@dataclass(frozen=True, slots=True)
class Section:
    """One section of first or second order; `b` (order + 1,), `a` (order,) without its leading 1."""

    form: str  # "shift" or "delta": what the coefficients are powers of
    b: tuple[float, ...]
    a: tuple[float, ...]


def sections(rational: Rational, form: str) -> tuple[Section, ...]:
    """Pair poles with the zeros nearest to them; the section nearest to the unit circle comes last, the gain first."""
    groups = sorted(_grouped(rational.poles), key=lambda group: float(np.max(np.abs(1 + group))), reverse=True)
    zeros = _grouped(rational.zeros)
    chosen: list[tuple[Roots, Roots]] = []
    for poles in groups:  # the pole with least choice, nearest to the circle, chooses first
        fitting = [k for k, group in enumerate(zeros) if len(group) <= len(poles)]
        if len(poles) == 2 and any(len(zeros[k]) == 2 for k in fitting):
            fitting = [k for k in fitting if len(zeros[k]) == 2]
        near = min(fitting, key=lambda k: float(np.min(np.abs(zeros[k][:, None] - poles))), default=None)
        chosen.append((poles, zeros.pop(near) if near is not None else np.zeros(0, np.complex128)))
    chosen.reverse()
    made = [_section(*each, form, gain) for each, gain in zip(chosen, _gains(rational.gain, chosen), strict=True)]
    return tuple(made)


def _gains(gain: float, chosen: list[tuple[Roots, Roots]]) -> list[float]:
    """Return what each section is multiplied by: the first by the whole gain, as far as a word holds that.

    A smaller one, of a low-pass of high order, is shared by powers of two that bring the peaks of the others to about 1
    (L. B. Jackson, Bell System Technical Journal 49 (1970) 159): all sections then work on signals of like size.
    """
    if abs(gain) >= SMALL or gain == 0.0:
        return [gain, *[1.0] * (len(chosen) - 1)][: len(chosen)]
    shares = [2.0 ** -round(math.log2(_peak(*each))) for each in chosen[1:]]
    return [gain / math.prod(shares), *shares]


def _peak(poles: Roots, zeros: Roots) -> float:
    """Return the greatest gain of a section on the unit circle; 1 where a pole lies on it."""
    if np.any(np.abs(1.0 + poles) >= 1.0 - 1e-12):
        return 1.0
    turns = np.concatenate([np.geomspace(1e-9, math.pi, 200), np.abs(np.angle(1.0 + poles))])
    at = np.exp(1j * turns) - 1.0
    above, below = (np.prod(at[:, None] - roots, axis=1) for roots in (zeros, poles))
    return float(np.max(np.abs(above / below)))


def _grouped(roots: Roots) -> list[Roots]:
    """Put complex pairs together, then real roots two by two, nearest to z = 1 first; a last one may stay alone."""
    pairs = [np.array([root, root.conjugate()]) for root in roots if root.imag > 0]
    real = sorted((root for root in roots if root.imag == 0), key=abs)
    return [*pairs, *(np.array(real[k : k + 2]) for k in range(0, len(real), 2))]


def _section(poles: Roots, zeros: Roots, form: str, gain: float) -> Section:
    order = len(poles)
    a: Array = np.real(np.poly(poles))
    b: Array = np.concatenate([np.zeros(order - len(zeros)), gain * np.atleast_1d(np.poly(zeros)).real])
    near = bool(np.all(np.abs(poles) < NEAR))
    if form == "delta" or (form == "auto" and near):
        return Section("delta", tuple(map(float, b)), tuple(map(float, a[1:])))
    return Section("shift", tuple(map(float, _in_z(b))), tuple(map(float, _in_z(a)[1:])))


def _in_z(delta: Array) -> Array:
    """Write a polynomial in z - 1 in powers of z; what is less than the rounding of its terms is 0."""
    if len(delta) == 2:
        found, size = np.array([delta[0], delta[1] - delta[0]]), np.abs(delta).sum()
    else:
        found = np.array([delta[0], delta[1] - 2 * delta[0], delta[2] - delta[1] + delta[0]])
        size = np.abs(delta).sum() + abs(delta[0])
    return np.where(np.abs(found) <= 2 * np.finfo(np.float64).eps * size, 0.0, found)
