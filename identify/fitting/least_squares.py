"""Minimize a sum of squares: the one place where a least-squares search is made.

`minimize` has unknowns that all blocks of residuals share and such that belong to one block alone, by
Levenberg-Marquardt with exact slopes. The shared unknowns are the parameters of a plant, the own ones the initial
state of each recording or window. A block is reduced to a small triangle as soon as it is computed (QR by blocks of
rows), and its own unknowns are eliminated from that triangle, so that a step costs little beside the simulation,
however many windows there are. SciPy's least_squares would decompose the whole Jacobian in every step.
`fit_function` hands `minimize` a plain function and its difference quotients; `descend` searches for a few unknowns
that are nearly linear; `scaled_step` is one Gauss-Newton step from normal equations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROWS = 512  # small enough that LAPACK stays in one thread and in the cache
_BLOCKS = 32  # of so many rows that are put side by side at a time
_ENOUGH = 1e-11  # relative decrease of the cost that is no longer worth a step
_QUOTIENT = 2.0**-26  # of an unknown, for a difference quotient: the root of what a number resolves
_DESCENTS = 20  # steps of `descend` at most
_DAMPINGS = (0.0, 1e-3, 1e-1, 1e1)  # that it tries in turn
_SETTLED = 1e-9  # relative decrease of the cost that is no longer worth a step of it
_SMALLEST = 1e-15  # relative step that no longer changes the unknowns


@dataclass(frozen=True, slots=True)
class Unknowns:
    """`shared` (k,) by all blocks, `own` (w, n) of each of w blocks."""

    shared: Array
    own: Array


@dataclass(frozen=True, slots=True)
class Reduced:
    """Triangles (w, m, m) of [own slopes, shared slopes, residual], m = n + k + 1, one per block.

    `tether` (t, k + 1) are further rows [shared slopes, residual].
    """

    blocks: Array
    tether: Array

    @property
    def cost(self) -> float:
        """Sum of squares of all residuals."""
        return float(np.sum(self.blocks[:, :, -1] ** 2) + np.sum(self.tether[:, -1] ** 2))


@dataclass(frozen=True, slots=True)
class Minimum:
    """Where the search ended, the sum of squares there, and how many evaluations it took."""

    place: Unknowns
    cost: float
    evaluations: int


def triangle(*columns: NDArray[np.floating[Any]]) -> Array:
    """Return R (m, m) of a QR decomposition of columns (rows, m_i) side by side, without forming Q.

    The rows are taken in by blocks, so that no more than the columns themselves is kept of them.
    """
    width = sum(each.shape[1] for each in columns)
    if width == 0:
        return np.zeros((0, 0))
    rows, count = max(_ROWS, 2 * width), len(columns[0])
    if count <= rows:
        top: Array = np.zeros((max(count, width), width))
        top[:count] = np.concatenate(columns, axis=1)
        return np.asarray(np.linalg.qr(top, mode="r"))
    tops = []
    for first in range(0, count, _BLOCKS * rows):
        taken = min(count - first, _BLOCKS * rows)
        block = np.zeros((-(-taken // rows), rows, width))
        np.concatenate([each[first : first + taken] for each in columns], axis=1, out=block.reshape(-1, width)[:taken])
        tops.append(np.asarray(np.linalg.qr(block, mode="r")).reshape(-1, width))
    return np.asarray(np.linalg.qr(np.concatenate(tops), mode="r"))


def joined(blocks: Sequence[Array]) -> Array:
    """Put blocks of rows below each other; a single one, which may be long, is not copied."""
    return blocks[0] if len(blocks) == 1 else np.concatenate(blocks)


def triangle_of(blocks: Iterable[Array]) -> Array:
    """Return R (m, m) of blocks (rows, m) of rows below each other."""
    return triangle(np.concatenate([triangle(block) for block in blocks]))


def minimize(
    evaluate: Callable[[Unknowns], Reduced], start: Unknowns, low: Array, high: Array, evaluations: int
) -> Minimum:
    """Minimize the sum of squares over low <= shared <= high, the own unknowns being unbounded.

    Damping follows Nielsen (1999); an unknown at a bound that wants to leave stays there for that step.
    """
    place = Unknowns(np.clip(start.shared, low, high), start.own)
    reduced, done, damping, growth = evaluate(place), 1, 1e-3, 2.0
    cost = reduced.cost
    while done < evaluations:
        pull = _pull(reduced)
        held = ((place.shared <= low) & (pull > 0.0)) | ((place.shared >= high) & (pull < 0.0))
        while done < evaluations:
            step = _damped_step(reduced, held, damping)
            trial = Unknowns(np.clip(place.shared + step.shared, low, high), place.own + step.own)
            moved = Unknowns(trial.shared - place.shared, step.own)
            gain = cost - _predicted(reduced, moved)
            if _still(moved, place) or 0.0 <= gain <= _ENOUGH * cost:
                return Minimum(place, cost, done)
            found = evaluate(trial)
            left = found.cost
            done += 1
            ratio = (cost - left) / gain if gain > 0.0 else -1.0
            if left < cost and ratio > 1e-4:
                place, reduced, cost = trial, found, left
                damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3), 1e-14)
                growth = 2.0
                break
            damping *= growth
            growth *= 2.0
            if damping > 1e20:
                return Minimum(place, cost, done)
    return Minimum(place, cost, done)


def fit_function(
    residual: Callable[[Array], Array], start: Array, scale: Array, low: Array, evaluations: int
) -> tuple[Array, Array]:
    """Minimize |residual(x)|^2 from `start` (k,) over x >= low; return x and its covariance (k, k).

    `scale` (k,) are their typical sizes, none of which is zero. The covariance is that of residuals that are white,
    s^2 (J'J)^-1; infinite where they leave an unknown open.
    """

    def slopes_at(place: Array, here: Array) -> Array:
        steps = _QUOTIENT * np.maximum(np.abs(place), 1.0) * np.where(place < 0.0, -1.0, 1.0)
        columns = [
            (residual((place + step * (np.arange(len(place)) == k)) * scale) - here) / step
            for k, step in enumerate(steps)
        ]
        return np.column_stack(columns)

    def evaluate(unknowns: Unknowns) -> Reduced:
        here = residual(unknowns.shared * scale)
        block = triangle(slopes_at(unknowns.shared, here), here[:, None])
        return Reduced(block[None], np.zeros((0, len(scale) + 1)))

    none = np.zeros((1, 0))
    found = minimize(evaluate, Unknowns(start / scale, none), low / scale, np.full(len(scale), np.inf), evaluations)
    place = found.place.shared
    here = residual(place * scale)
    slopes, freedom = slopes_at(place, here), len(here) - len(place)
    square = slopes.T @ slopes
    open_end = freedom <= 0 or np.linalg.matrix_rank(square) < len(place)
    covariance = np.full_like(square, np.inf) if open_end else np.linalg.inv(square) * (here @ here / freedom)
    return place * scale, covariance * np.outer(scale, scale)


def descend(
    cost_at: Callable[[Array], float], reduced_at: Callable[[Array], Array | None], start: Array
) -> tuple[float, Array]:
    """Search from `start` (n,) by Gauss-Newton, damped (Levenberg) where a full step does not help: (cost, place).

    `reduced_at(place)` is the triangle of [slopes, residual], None where there is none, as of a simulation that
    diverges; infinite cost where that is so at the start. `cost_at(place)` is the square of that residual, which costs
    no slopes; infinite where there is none.
    """
    small = reduced_at(start)
    if small is None:
        return np.inf, start
    place, cost = start, float(small[:, -1] @ small[:, -1])
    for _ in range(_DESCENTS):
        reach = np.linalg.norm(small[:, :-1], axis=0)
        reach[reach == 0.0] = 1.0
        for damping in _DAMPINGS:
            tall = np.concatenate([small[:, :-1] / reach, np.sqrt(damping) * np.eye(len(place))])
            aim = np.concatenate([-small[:, -1], np.zeros(len(place))])
            step, *_ = np.linalg.lstsq(tall, aim, rcond=1e-9)
            trial = cost_at(place + step / reach)
            if trial < cost:
                break
        else:
            break
        place, last, cost = place + step / reach, cost, trial
        if last - cost <= _SETTLED * last or (small := reduced_at(place)) is None:
            break
    return cost, place


def scaled_step(square: Array, pull: Array, determined: float) -> tuple[Array, Array]:
    """Solve square step = pull (n,) with unknowns scaled to one size; return the step, and as it is scaled.

    Directions that are determined less than by `determined` of the best one stay where they are, and so do unknowns
    without any trace: what rounding makes of them, divided by a size of next to nothing, was a step of 1e130.
    """
    sizes = np.sqrt(np.maximum(np.diag(square), 0.0))
    sizes[sizes == 0.0] = np.inf
    scaled = np.linalg.lstsq(square / np.outer(sizes, sizes), pull / sizes, rcond=determined)[0]
    return scaled / sizes, scaled


def _pull(reduced: Reduced) -> Array:
    """Gradient (k,) of half the cost for the shared unknowns."""
    count = reduced.tether.shape[1] - 1
    own = reduced.blocks.shape[2] - count - 1
    blocks = np.einsum("wrk,wr->k", reduced.blocks[:, :, own:-1], reduced.blocks[:, :, -1])
    return np.asarray(blocks + reduced.tether[:, :-1].T @ reduced.tether[:, -1])


def _predicted(reduced: Reduced, moved: Unknowns) -> float:
    """Cost after a step, by the linear model."""
    steps = np.concatenate([moved.own, np.broadcast_to(moved.shared, (len(moved.own), len(moved.shared)))], axis=1)
    blocks = np.einsum("wrm,wm->wr", reduced.blocks[:, :, :-1], steps) + reduced.blocks[:, :, -1]
    tether = reduced.tether[:, :-1] @ moved.shared + reduced.tether[:, -1]
    return float(np.sum(blocks**2) + np.sum(tether**2))


def _still(moved: Unknowns, place: Unknowns) -> bool:
    shared = np.abs(moved.shared) <= _SMALLEST * np.abs(place.shared)
    own = np.abs(moved.own) <= _SMALLEST * np.abs(place.own)
    return bool(np.all(shared) and np.all(own))


def _damped_step(reduced: Reduced, held: NDArray[np.bool_], damping: float) -> Unknowns:
    """Solve the damped linear problem: own unknowns are eliminated block by block, then follow from the shared ones."""
    count = reduced.tether.shape[1] - 1
    windows, _, width = reduced.blocks.shape
    own = width - count - 1
    sizes = np.linalg.norm(reduced.blocks[:, :, :own], axis=1)
    sizes[sizes == 0.0] = 1.0
    rows = np.zeros((windows, own, width))
    rows[:, np.arange(own), np.arange(own)] = np.sqrt(damping) * sizes
    triangles = np.asarray(np.linalg.qr(np.concatenate([reduced.blocks, rows], axis=1), mode="r"))
    rest = np.concatenate([triangles[:, own:, own:].reshape(-1, count + 1), reduced.tether])
    scale = np.linalg.norm(
        np.concatenate([reduced.blocks[:, :, own:-1].reshape(windows * width, count), reduced.tether[:, :-1]]), axis=0
    )
    free = np.flatnonzero(~held & (scale > 0.0))
    shared = np.zeros(count)
    tall = np.concatenate([rest[:, free] / scale[free], np.sqrt(damping) * np.eye(len(free))])
    aim = np.concatenate([-rest[:, -1], np.zeros(len(free))])
    answer, *_ = np.linalg.lstsq(tall, aim, rcond=None)
    shared[free] = answer / scale[free]
    target = -triangles[:, :own, -1] - triangles[:, :own, own:-1] @ shared
    return Unknowns(shared, np.linalg.solve(triangles[:, :own, :own], target[..., None])[..., 0])


def regressed(regressors: Array, change: Array) -> tuple[Array, Array, float] | None:
    """Return coefficients (k,) of regressors (n, k), their standard deviations for white errors, and the squares left.

    None where a regressor is nothing, or not finite: then nothing follows of the others.
    """
    size = np.linalg.norm(regressors, axis=0)
    if np.any(size == 0.0) or not np.all(np.isfinite(size)):
        return None
    even = regressors / size
    found = np.linalg.lstsq(even, change, rcond=None)[0]
    rest = change - even @ found
    left = float(rest @ rest)
    spread = np.maximum(np.diag(np.linalg.pinv(even.T @ even)) * left / len(change), 0.0)
    return found / size, np.sqrt(spread) / size, left
