"""Turn the Jacobian of a fit into standard deviations, and find what the data cannot tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.effective_samples import Pure, deviations_under, noises_of, widened
from firmloop.identify.fitting.least_squares import joined, triangle, triangle_of
from firmloop.identify.plants.plant import Parameter, Plant

Array = NDArray[np.float64]

# Parallel to 1e-6 of their length: far above the rounding of exact sensitivities (1e-10), far below any real data.
_PARALLEL = 1e-6
_MOST_LAGS = 2000
_FEW = 200.0  # independent samples; with as many, Student's t is the normal distribution to 0.6 %


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """`covariance` (k, k) of the parameters; `blind` lists those (indices) that stand in a combination of no effect.

    `combinations` is how many such combinations there are: that many of the blind ones have to be fixed.
    """

    covariance: Array
    blind: tuple[int, ...]
    combinations: int


Doubt = Callable[[Sequence[int], Sequence[Array], Sequence[Array], Array], Uncertainty]  # see `uncertainty`


def uncertainty(
    windows: Sequence[int], residuals: Sequence[Array], slopes: Sequence[Array], natural: Array
) -> Uncertainty:
    """Covariance of the parameters of a least-squares fit whose residuals may be coloured.

    `windows` says how many experiments each recording has; every experiment has residuals (q, r) weighted to about
    unit variance, and their slopes (q, r, k + n), first for the parameters and then for its own initial state;
    `natural` (k,) is what counts as a large change of each parameter, by which a combination without effect is judged.

    The estimator is the sandwich H^-1 S H^-1 with H = sum J'J and S the long-run covariance of the scores J'e, by
    Bartlett weights and Andrews' automatic bandwidth (Newey & West 1987, Andrews 1991): right for white and for
    autocorrelated residuals, as long as their memory is short against the recording. Where a few rows decide alone, a
    delay's at the edge of a step, S has little to go by and comes out small: then the variances are those of stationary
    residuals, H^-1 (sum J'C J) H^-1 with C the covariance of the autoregression that the residuals of each output tell
    (white ones: sigma^2 H^-1), the larger of the two each time. Where that noise is so slow that the rows count as few
    independent samples, they are widened until 1.96 deviations hold 95 % again, see
    `identify/fitting/effective_samples.py`.
    """
    if not all(np.all(np.isfinite(block)) for block in slopes):
        return untold(windows, residuals, slopes, natural)  # beside what diverges nothing is known
    parameters = len(natural)
    tall = [block.reshape(-1, block.shape[2]) for block in slopes]
    own = [_span(block[:, parameters:]) for block in tall]
    # What a change of the initial state could do as well is taken out of the parameters' columns.
    matrix = triangle_of(
        triangle(span, block[:, :parameters])[span.shape[1] :, span.shape[1] :]
        for block, span in zip(tall, own, strict=True)
    )
    every = triangle_of(block[:, :parameters] for block in tall)
    norms = np.linalg.norm(every, axis=0)
    felt = norms * np.where(natural > 0.0, natural, 1.0)  # whatever unit each parameter is in
    norms[felt <= _PARALLEL**2 * felt.max(initial=0.0)] = 1.0
    _, sizes, axes = np.linalg.svd(matrix / norms)
    seen = sizes > _PARALLEL
    reach = norms * np.where(natural > 0.0, natural, 1.0 / norms)
    idle, _ = np.linalg.qr((axes[~seen] / reach).T)
    blind = np.flatnonzero(np.sum(idle**2, axis=1) > 1e-4)
    inverse = (axes[seen].T / sizes[seen] ** 2) @ axes[seen]
    clean = [
        Pure(block[:, :parameters], span, 1.0 / norms, part.shape)
        for block, span, part in zip(tall, own, residuals, strict=True)
    ]
    meat = np.zeros_like(inverse)
    for first, end in pairwise(np.cumsum([0, *windows]).tolist()):
        pairs = zip(clean[first:end], residuals[first:end], strict=True)
        # With the initial states projected out of J, the scores of the parameters alone carry the sandwich.
        meat += _long_run(joined([_scores(block, part) for block, part in pairs]))
    rows = sum(residual.size for residual in residuals)
    unknowns = parameters + sum(block.shape[2] - parameters for block in slopes)
    lost = rows / max(rows - unknowns, 1)
    robust = inverse @ meat @ inverse
    noises = noises_of(residuals)
    plain = deviations_under(noises, clean, inverse)
    if np.any(plain**2 * _FEW > np.diag(inverse) * rows):
        plain = widened(noises, clean, inverse, lost**0.5)
    wider = np.maximum(plain / np.sqrt(np.maximum(np.diag(robust), 1e-300)), 1.0)
    covariance = lost * robust * np.outer(wider, wider) / np.outer(norms, norms)
    return Uncertainty(0.5 * (covariance + covariance.T), tuple(int(k) for k in blind), int(np.sum(~seen)))


def untold(windows: Sequence[int], residuals: Sequence[Array], slopes: Sequence[Array], natural: Array) -> Uncertainty:
    """Ask nothing, where `uncertainty` would take as long as the fit: every covariance is NaN."""
    return Uncertainty(np.full((len(natural), len(natural)), np.nan), (), 0)


def _span(columns: Array) -> Array:
    """Return an orthonormal basis (rows, n) of what columns (rows, m) span, parallel ones counted once."""
    norms = np.linalg.norm(columns, axis=0)
    norms[norms == 0.0] = 1.0
    _, widths, turned = np.linalg.svd(triangle(columns / norms))
    kept = widths > _PARALLEL
    return np.asarray((columns / norms) @ (turned[kept].T / widths[kept]))


def _scores(block: Pure, residual: Array) -> Array:
    """Return slopes times residuals (q, k), summed over the outputs."""
    found = np.empty((len(residual), block.parameters))
    for k, direction in enumerate(np.eye(block.parameters)):
        np.sum(block.along(direction) * residual, axis=1, out=found[:, k])
    return found


def _long_run(scores: Array) -> Array:
    """Sum of the autocovariances (k, k) of scores (q, k) over all lags, times q."""
    rows = len(scores)
    total = np.asarray(scores.T @ scores)
    lags = min(_bandwidth(scores), rows // 4, _MOST_LAGS)
    for lag in range(1, lags + 1):
        product = scores[lag:].T @ scores[:-lag]
        total = total + (1.0 - lag / (lags + 1.0)) * (product + product.T)
    return total


def _bandwidth(scores: Array) -> int:
    """Andrews (1991), equations 6.2 and 6.4: first-order autoregressions of the scores set the Bartlett bandwidth."""
    slopes, variances = [], []
    for column in scores.T:
        now, before = column[1:], column[:-1]
        power = float(before @ before)
        if power > 0.0:
            slopes.append(float(np.clip(float(now @ before) / power, -0.97, 0.97)))
            variances.append(float(np.mean((now - slopes[-1] * before) ** 2)))
    if not slopes:
        return 0
    slope, variance = np.array(slopes), np.array(variances)
    weight = variance**2
    top = np.sum(weight * 4.0 * slope**2 / ((1.0 - slope) ** 6 * (1.0 + slope) ** 2))
    bottom = np.sum(weight / (1.0 - slope) ** 4)
    return int(1.1447 * (top / bottom * len(scores)) ** (1.0 / 3.0)) if bottom > 0.0 else 0


def possible(plant: Plant, parameters: Sequence[Parameter]) -> bool:
    """Tell whether the equations hold at these values: not where one divides by a time constant of zero."""
    values = [parameter.value for parameter in parameters[: plant.rate.numel_in(2)]]
    rate = plant.rate(np.ones(plant.rate.numel_in(0)), np.ones(plant.rate.numel_in(1)), values)
    return bool(np.all(np.isfinite(np.array(rate))))


def as_found(parameter: Parameter, value: float, deviation: float, alone: float) -> Parameter:
    """Set what was found; the solver stops just inside a bound, which is the bound as far as the data can tell.

    Beside the others as they are, too, by its deviation `alone`: of two lags that are hardly told from one another
    neither is zero. A bound that is impossible itself, a time constant of zero, is none that a value can be.
    """
    if not math.isfinite(deviation):
        return replace(parameter, value=value, deviation=None)
    for bound in (parameter.low, parameter.high):
        if abs(value - bound) < min(1e-3 * deviation, 0.1 * alone) and not parameter.logarithmic:
            value = bound
    return replace(parameter, value=value, deviation=deviation)
