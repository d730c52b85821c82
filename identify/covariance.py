"""Turn the Jacobian of a fit into standard deviations, and find what the data cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identify.least_squares import triangle
from identify.noise import fit_noise

Array = NDArray[np.float64]

# Parallel to 1e-6 of their length: far above the rounding of exact sensitivities (1e-10), far below any real data.
_PARALLEL = 1e-6
_MOST_LAGS = 2000
_STABLE = 0.999  # largest pole of an autoregression of residuals


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """`covariance` (k, k) of the parameters; `blind` lists those (indices) that stand in a combination of no effect.

    `combinations` is how many such combinations there are: that many of the blind ones have to be fixed.
    """

    covariance: Array
    blind: tuple[int, ...]
    combinations: int


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
    (white ones: sigma^2 H^-1), the larger of the two each time.
    """
    parameters = len(natural)
    pure = [_without_start(block.reshape(-1, block.shape[2]), parameters) for block in slopes]
    # With the initial states projected out of J, the scores of the parameters alone carry the sandwich.
    matrix = triangle(np.concatenate(pure))
    whole = [block[..., :parameters].reshape(len(part), parameters) for block, part in zip(slopes, pure, strict=True)]
    every = triangle(np.concatenate(whole))
    norms = np.linalg.norm(every, axis=0)
    norms[norms <= _PARALLEL**2 * norms.max(initial=0.0)] = 1.0
    _, sizes, axes = np.linalg.svd(matrix / norms)
    seen = sizes > _PARALLEL
    reach = norms * np.where(natural > 0.0, natural, 1.0 / norms)
    idle, _ = np.linalg.qr((axes[~seen] / reach).T)
    blind = np.flatnonzero(np.sum(idle**2, axis=1) > 1e-4)
    inverse = (axes[seen].T / sizes[seen] ** 2) @ axes[seen]
    scores = []
    for residual, block in zip(residuals, pure, strict=True):
        each = (block / norms).reshape(*residual.shape, parameters)
        scores.append(np.einsum("qrk,qr->qk", each, residual))
    meat = np.zeros_like(inverse)
    for first, end in pairwise(np.cumsum([0, *windows]).tolist()):
        meat += _long_run(np.concatenate(scores[first:end]))
    rows = sum(residual.size for residual in residuals)
    unknowns = parameters + sum(block.shape[2] - parameters for block in slopes)
    tall = [(block / norms).reshape(*part.shape, parameters) for part, block in zip(residuals, pure, strict=True)]
    stationary = np.zeros_like(inverse)
    for k in range(residuals[0].shape[1]):
        stationary += _stationary([part[:, k] for part in residuals], [each[:, k] for each in tall])
    robust, plain = inverse @ meat @ inverse, inverse @ stationary @ inverse
    ratio = np.diag(plain) / np.maximum(np.diag(robust), 1e-300)
    wider = np.sqrt(np.maximum(ratio, 1.0))
    covariance = rows / max(rows - unknowns, 1) * robust * np.outer(wider, wider) / np.outer(norms, norms)
    return Uncertainty(0.5 * (covariance + covariance.T), tuple(int(k) for k in blind), int(np.sum(~seen)))


def _without_start(tall: Array, parameters: int) -> Array:
    """Take out of the parameters' columns what a change of the initial state could do as well."""
    own = tall[:, parameters:]
    norms = np.linalg.norm(own, axis=0)
    norms[norms == 0.0] = 1.0
    _, widths, turned = np.linalg.svd(triangle(own / norms))
    kept = widths > _PARALLEL
    basis = (own / norms) @ (turned[kept].T / widths[kept])
    return np.asarray(tall[:, :parameters] - basis @ (basis.T @ tall[:, :parameters]))


def _stationary(residuals: Sequence[Array], slopes: Sequence[Array]) -> Array:
    """Return sum J'C J (k, k) of one output: residuals (q,) and slopes (q, k) of every experiment."""
    if not slopes[0].shape[1]:
        return np.zeros((0, 0))
    noise = fit_noise(residuals, 0.0)
    taps = noise.coefficients
    radius = float(np.max(np.abs(np.roots([1.0, *taps])), initial=0.0))
    held = taps * min(1.0, _STABLE / max(radius, 1e-300)) ** np.arange(1, len(taps) + 1)
    # Residuals are e / (1 + taps), so that J'residuals is e times J sent through 1 / (1 + taps) backwards.
    turned = [lfilter([1.0], [1.0, *held], each[::-1], axis=0) for each in slopes]
    return np.asarray(noise.scale**2 * sum(each.T @ each for each in turned))


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
    now, before = scores[1:], scores[:-1]
    power = np.sum(before**2, axis=0)
    moving = power > 0.0
    if not np.any(moving):
        return 0
    slope = np.clip(np.sum(now * before, axis=0)[moving] / power[moving], -0.97, 0.97)
    variance = np.mean((now[:, moving] - slope * before[:, moving]) ** 2, axis=0)
    weight = variance**2
    top = np.sum(weight * 4.0 * slope**2 / ((1.0 - slope) ** 6 * (1.0 + slope) ** 2))
    bottom = np.sum(weight / (1.0 - slope) ** 4)
    return int(1.1447 * (top / bottom * len(scores)) ** (1.0 / 3.0)) if bottom > 0.0 else 0
