"""Expand the simulations of a fit to second order around its solution, so that a refit nearby simulates nothing.

With d the coordinates' way from the solution, J the weighted slopes there and H their own slopes, by differences::

    weighted residual(d) = e + J d + 1/2 d' H d = e + [J, H] f(d)        f = (d_a ..., d_a d_b/(1 + (a = b)) ...)

[J, H] = Q R: a refit needs Q' e of the drawn noise, R, and no row of the recording. It is an approximation whose error
is measured, not assumed: whoever uses it refits some draws by simulations too, those that went farthest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.problem import FitPoint, FitProblem, at_coordinates, weighted

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # weighted residuals (q, r) and their slopes (q, r, f + n)

_LEAST = 1e-9  # of the largest step: a coordinate that leaves no trace is moved by no infinite one


@dataclass(frozen=True, slots=True)
class Expanded:
    """One experiment: `basis` (q r, m) and `triangle` (m, monomials of f), its residuals at the solution left out."""

    basis: Array
    triangle: Array


@dataclass(frozen=True, slots=True)
class Expansion:
    """All experiments of a fit around `place` (f,) and `starts` (w, n)."""

    place: Array
    starts: Array
    experiments: tuple[Expanded, ...]

    def pairs(self, seen: Sequence[Array], place: Array, starts: Array) -> list[Pair]:
        """Return residuals and slopes for noise of which `seen` are the parts within each basis."""
        made = []
        for one, noise, moved in zip(self.experiments, seen, starts - self.starts, strict=True):
            values, rates = _monomials(np.concatenate([place - self.place, moved]))
            made.append(((noise + one.triangle @ values)[:, None], (one.triangle @ rates)[:, None, :]))
        return made


def expand(problem: FitProblem, point: FitPoint, place: Array, slopes: Sequence[Array]) -> Expansion:
    """Expand around `point`, whose free parameters have the coordinates `place` and whose slopes are known."""
    count, states = len(place), point.starts.shape[1]
    sizes = np.sqrt(sum(np.einsum("qra,qra->a", one[..., :count], one[..., :count]) for one in slopes))
    own = np.sqrt(np.stack([np.einsum("qra,qra->a", one[..., count:], one[..., count:]) for one in slopes]))
    steps, first = _steps(sizes), _steps(own)
    seconds = [np.empty((*one.shape, count + states)) for one in slopes]
    for axis in range(count + states):
        ends = []
        for sign in (1.0, -1.0):
            moved, starts = place.copy(), point.starts.copy()
            if axis < count:
                moved[axis] += sign * steps[axis]
            else:
                starts[:, axis - count] += sign * first[:, axis - count]
            ends.append(
                [rates for _, rates in weighted(problem, at_coordinates(problem, point.constants, moved, starts))]
            )
        for k, (up, down) in enumerate(zip(*ends, strict=True)):
            width = steps[axis] if axis < count else first[k, axis - count]
            seconds[k][..., axis] = (up - down) / (2.0 * width)
    made = []
    for one, second in zip(slopes, seconds, strict=True):
        even = 0.5 * (second + np.swapaxes(second, -1, -2))
        a, b = np.triu_indices(count + states)
        whole = np.concatenate([one, even[..., a, b]], axis=-1)
        made.append(Expanded(*np.linalg.qr(whole.reshape(-1, whole.shape[-1]))))
    return Expansion(place, point.starts, tuple(made))


def _steps(sizes: Array) -> Array:
    """Return steps that move the weighted residuals by about a standard deviation."""
    largest = float(np.max(sizes, initial=0.0)) or 1.0
    return np.asarray(1.0 / np.maximum(sizes, _LEAST * largest))


def _monomials(moved: Array) -> tuple[Array, Array]:
    """Return f (m + m (m + 1)/2,) at `moved` (m,), and its slopes (..., m)."""
    count = len(moved)
    a, b = np.triu_indices(count)
    rows = np.arange(len(a))
    slopes = np.zeros((len(a), count))
    slopes[rows, a] += moved[b]
    slopes[rows, b] += moved[a]
    half = np.where(a == b, 0.5, 1.0)
    return np.concatenate([moved, half * moved[a] * moved[b]]), np.concatenate([np.eye(count), half[:, None] * slopes])
