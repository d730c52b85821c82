"""Widen intervals where the noise is so slow that a recording holds few independent samples of it.

The size and the memory of such a noise are estimated from the same few samples, and come out too small: what a fit
leaves over lacks what the parameters took with them. The remedy is the parametric bootstrap of the studentised
estimate (Efron & Tibshirani 1993, chapter 12): noise of the fitted autoregression is drawn anew, sent through the
linearised fit and judged as the recording was. No refits are needed, and the draws are the same each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.noise import Noise, fit_noise
from firmloop.identify.normal import NORMAL_95

Array = NDArray[np.float64]

_STABLE = 0.999  # largest pole of an autoregression of residuals
_DRAWS = 200
_SETTLE = 3000  # rows before a drawn noise is used: three time constants of the slowest pole


def noises_of(residuals: Sequence[Array]) -> list[Noise]:
    """Return a stationary autoregression of each output of residuals (q, r) of every experiment."""
    return [_stationary([part[:, k] for part in residuals]) for k in range(residuals[0].shape[1])]


def _stationary(residuals: Sequence[Array]) -> Noise:
    noise = fit_noise(residuals, 0.0)
    radius = float(np.max(np.abs(np.roots([1.0, *noise.coefficients])), initial=0.0))
    shrunk = min(1.0, _STABLE / max(radius, 1e-300)) ** np.arange(1, len(noise.coefficients) + 1)
    return replace(noise, coefficients=noise.coefficients * shrunk)


def deviations_under(noises: Sequence[Noise], sway: Sequence[Array]) -> Array:
    """Return standard deviations (k,) of sum sway * noise, with sway (q, r, k) of every experiment: of sway' C sway."""
    count = sway[0].shape[2]
    total = np.zeros(count)
    for column, noise in enumerate(noises if count else ()):
        for each in sway:
            # The noise is e / A, so that sway' noise is e times sway sent through 1 / A backwards.
            total += noise.scale**2 * np.sum(noise.color(each[::-1, column]) ** 2, axis=0)
    return np.sqrt(total)


def widened(
    noises: Sequence[Noise], slopes: Sequence[Array], own: Sequence[Array], sway: Sequence[Array], lost: float
) -> Array:
    """Return the deviations under `noises` (k,), widened such that 1.96 of them hold 95 % of the estimates.

    They are to be multiplied by `lost`, for the degrees of freedom that the fit has used.

    `slopes` (q, r, k) of the parameters, with what is `own` (q r, n; orthonormal) to each experiment taken out, and
    `sway` (q, r, k), what each row's noise does to the parameters. Two faults are mended: estimates are spread wider in
    units of a drawn noise's deviation than a normal one is, and the deviation that draws tell is less than that which
    they were drawn with, so that the recording's will be less than the true one by as much.
    """
    random = np.random.default_rng(0)
    apart, told = [], []
    for _ in range(_DRAWS):
        drawn = [_draw(noises, len(each), random) for each in sway]
        error = sum(np.einsum("qrk,qr->k", each, part) for each, part in zip(sway, drawn, strict=True))
        left = []
        for part, slope, span in zip(drawn, slopes, own, strict=True):
            flat = part.ravel()
            left.append((flat - span @ (span.T @ flat)).reshape(part.shape) - slope @ error)
        told.append(lost * deviations_under(noises_of(left), sway))
        apart.append(np.abs(error) / np.maximum(told[-1], 1e-300))
    wider = np.quantile(apart, 0.95, axis=0) / NORMAL_95
    plain = deviations_under(noises, sway)
    shy = plain / np.maximum(np.median(told, axis=0), 1e-300)
    return np.asarray(plain * np.maximum(wider, 1.0) * np.maximum(shy, 1.0))


def _draw(noises: Sequence[Noise], rows: int, random: np.random.Generator) -> Array:
    """Return noise (rows, r) of each output's autoregression."""
    columns = [noise.color(random.normal(0.0, noise.scale, _SETTLE + rows))[_SETTLE:] for noise in noises]
    return np.stack(columns, axis=1)
