"""Widen intervals where the noise is so slow that a recording holds few independent samples of it.

The size and the memory of such a noise are estimated from the same few samples, and come out too small: what a fit
leaves over lacks what the parameters took with them. The remedy is the parametric bootstrap of the studentised
estimate (Efron & Tibshirani 1993, chapter 12): noise of the fitted autoregression is drawn anew, sent through the
linearised fit and judged as the recording was. No refits are needed, and the draws are the same each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.noise import Noise, fit_noise
from firmloop.identify.normal import NORMAL_95

Array = NDArray[np.float64]

_STABLE = 0.999  # largest pole of an autoregression of residuals
_SURELY = 0.97  # sum of coefficients, at most 24, below which no pole lies farther out (Cauchy's bound)
_DRAWS = 200
_SETTLE = 3000  # rows before a drawn noise is used: three time constants of the slowest pole


def noises_of(residuals: Sequence[Array]) -> list[Noise]:
    """Return a stationary autoregression of each output of residuals (q, r) of every experiment."""
    return [_stationary([part[:, k] for part in residuals]) for k in range(residuals[0].shape[1])]


def _stationary(residuals: Sequence[Array]) -> Noise:
    noise = fit_noise(residuals, 0.0)
    if np.sum(np.abs(noise.coefficients)) < _SURELY:
        return noise
    radius = float(np.max(np.abs(np.roots([1.0, *noise.coefficients])), initial=0.0))
    shrunk = min(1.0, _STABLE / max(radius, 1e-300)) ** np.arange(1, len(noise.coefficients) + 1)
    return replace(noise, coefficients=noise.coefficients * shrunk)


@dataclass(frozen=True, slots=True)
class Pure:
    """Slopes of an experiment's residuals for the parameters, without what its initial state can do as well.

    They are `columns` (q r, k) times `scale` (k,), less their part in the orthonormal `own` (q r, n); `shape` is
    (q, r). The columns are long, and one combination of them is wanted at a time.
    """

    columns: Array
    own: Array
    scale: Array
    shape: tuple[int, ...]

    @property
    def parameters(self) -> int:
        """How many columns there are."""
        return len(self.scale)

    def along(self, direction: Array) -> Array:
        """Return a combination (k,) of the columns, (q, r)."""
        return self.without_own(self.columns @ (self.scale * direction)).reshape(self.shape)

    def without_own(self, values: Array) -> Array:
        """Return values (q r,) without what the initial state can do."""
        return np.asarray(values - self.own @ (self.own.T @ values))


def deviations_under(noises: Sequence[Noise], slopes: Sequence[Pure], inverse: Array) -> Array:
    """Return standard deviations (k,) of sum sway * noise, sway = slopes inverse: of sway' C sway."""
    one_by_one = ([each.along(direction)[..., None] for each in slopes] for direction in inverse.T)
    return np.array([float(_deviations(noises, sway)[0]) for sway in one_by_one])


def _sway(slopes: Pure, inverse: Array) -> Array:
    """Return what each row's noise does to each parameter, (q, r, k)."""
    return np.stack([slopes.along(direction) for direction in inverse.T], axis=-1)


def _deviations(noises: Sequence[Noise], sway: Sequence[Array]) -> Array:
    total = np.zeros(sway[0].shape[2])
    for each in sway:
        for column, noise in enumerate(noises):
            # The noise is e / A, so that sway' noise is e times sway sent through 1 / A backwards.
            backwards = np.asfortranarray(noise.color(each[::-1, column]))
            total += noise.scale**2 * np.array([float(one @ one) for one in backwards.T])
    return np.sqrt(total)


def widened(noises: Sequence[Noise], slopes: Sequence[Pure], inverse: Array, lost: float) -> Array:
    """Return the deviations under `noises` (k,), widened such that 1.96 of them hold 95 % of the estimates.

    They are to be multiplied by `lost`, for the degrees of freedom that the fit has used.

    What each row's noise does to the parameters is `slopes` times `inverse` (k, k). Two faults are mended: estimates
    are spread wider in units of a drawn noise's deviation than a normal one is, and the deviation that draws tell is
    less than that which they were drawn with, so that the recording's will be less than the true one by as much.
    """
    random = np.random.default_rng(0)
    sway = [_sway(each, inverse) for each in slopes]
    apart, told = [], []
    for _ in range(_DRAWS):
        drawn = [drawn_from(noises, each.shape[0], random) for each in slopes]
        error = sum(np.einsum("qrk,qr->k", each, part) for each, part in zip(sway, drawn, strict=True))
        left = [
            each.without_own(part.ravel()).reshape(part.shape) - each.along(error)
            for part, each in zip(drawn, slopes, strict=True)
        ]
        told.append(lost * _deviations(noises_of(left), sway))
        apart.append(np.abs(error) / np.maximum(told[-1], 1e-300))
    wider = np.quantile(apart, 0.95, axis=0) / NORMAL_95
    plain = _deviations(noises, sway)
    shy = plain / np.maximum(np.median(told, axis=0), 1e-300)
    return np.asarray(plain * np.maximum(wider, 1.0) * np.maximum(shy, 1.0))


def drawn_from(noises: Sequence[Noise], rows: int, random: np.random.Generator) -> Array:
    """Return noise (rows, r) of each output's autoregression."""
    columns = [noise.color(random.normal(0.0, noise.scale, _SETTLE + rows))[_SETTLE:] for noise in noises]
    return np.stack(columns, axis=1)
