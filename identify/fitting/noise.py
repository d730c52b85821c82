"""Model the noise of each output as autoregressive, so that evidence is counted in independent samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import erfc

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs

from firmloop.identify.simulation.linear_filter import filtered

Array = NDArray[np.float64]

ORDERS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24)
_BY_CHANCE = 3.0  # deviations of what coefficients take of white noise
_FEWEST = 40  # rows per coefficient: fewer would fit the noise of the noise


@dataclass(frozen=True, slots=True)
class Noise:
    """One output's noise: v[k] = -sum a[j] v[k-j] + e[k]; `scale` is the rms of e, `rms` that of v."""

    coefficients: Array  # (order,)
    scale: float  # output's unit
    rms: float  # output's unit
    surplus: float = 0.0  # by how much -2 log likelihood is worse for more than the noise may be, see `bounded`
    weight: float = 0.0  # per unit of the output: what a value counts itself, beside its innovation, see `bounded`
    samples: float = 1.0  # independent ones that a row counts as

    def whiten(self, values: Array) -> Array:
        """Return values (q, ...) along the first axis in units of the innovation; the first rows start from rest."""
        if len(self.coefficients) == 0:
            return np.asarray(values / (self.scale / self.samples**0.5))
        return filtered(np.concatenate([[1.0], self.coefficients]) / self.scale, np.ones(1), values)

    def unlikely(self, rows: int) -> float:
        """Return -2 log likelihood of `rows` rows that it was fitted to, but for a constant, and its price by BIC."""
        price = len(self.coefficients) * float(np.log(max(rows, 2)))
        return 2.0 * rows * self.samples * float(np.log(self.scale)) + price + self.surplus

    def color(self, innovations: Array) -> Array:
        """Return the noise (q, ...) along the first axis that innovations in the output's unit make, from rest."""
        return filtered(np.ones(1), np.concatenate([[1.0], self.coefficients]), innovations)


def white(scale: float) -> Noise:
    """Return noise without memory."""
    return Noise(np.zeros(0), scale, scale)


def flat(noises: Sequence[Noise]) -> tuple[Noise, ...]:
    """Return noises of the same sizes without memory."""
    return tuple(replace(white(noise.rms), samples=noise.samples) for noise in noises)


def colored(noises: Sequence[Noise]) -> bool:
    """Tell whether any of them has a memory."""
    return any(len(noise.coefficients) for noise in noises)


def plain_too(noises: Sequence[Noise]) -> tuple[tuple[Noise, ...], ...]:
    """Return the noises as they are and without memory; once, where both are the same."""
    alike = not colored(noises) and not oversized(noises)
    return (tuple(noises),) if alike else (tuple(noises), flat(noises))


def oversized(noises: Sequence[Noise]) -> bool:
    """Tell whether any of them is larger than noise may be, see `bounded`: motion that the plant does not make."""
    return any(noise.weight > 0.0 for noise in noises)


def fit_noise(residuals: Sequence[Array], floor: float, orders: Sequence[int] = ORDERS) -> Noise:
    """Fit one output's noise to residuals (q,) of several recordings, by least squares over all of them.

    Least squares and not Yule-Walker, which is badly biased where a disturbance has been integrated. The order is the
    one with the smallest BIC among `orders`. `floor` is the smallest innovation rms that a sensor of this resolution
    can have (output's unit). What is not finite, as a diverged simulation leaves it, is infinite noise.
    """
    rows = sum(len(part) for part in residuals)
    most = max((order for order in orders if order * _FEWEST <= rows), default=0)
    mean = float(np.sum([np.sum(part) for part in residuals])) / max(rows, 1)
    rms = max(float(np.sqrt(np.sum([part @ part for part in residuals]) / max(rows, 1))), floor)
    if not np.isfinite(rms):
        return white(np.inf)
    moments = np.zeros((most + 1, most + 1))
    used = 0
    for part in residuals:
        if len(part) > 2 * most:
            moments += lagged_products(part, most)
            used += len(part) - most
    if used == 0 or not moments[0, 0] > 0.0:
        return white(rms)
    best, least, best_score = 0, float(moments[0, 0]) / used, np.inf
    past = moments[1:, 1:] + 1e-9 * float(moments[0, 0]) * np.eye(most)
    # What each further coefficient takes away, all orders by one factorization: they are nested.
    try:
        factor = np.linalg.cholesky(past)
    except np.linalg.LinAlgError:  # past a residual that dies out, rounding is all that is left
        factor, fails = dpotrf(past, lower=1)
        most = fails - 1
    # The call of LAPACK alone: what SciPy asks before it takes ten times as long as these few numbers.
    removed = dtrtrs(factor[:most, :most].T, moments[0, 1 : most + 1], lower=0, trans=1)[0] if most else np.zeros(0)
    taken = np.cumsum(removed**2)
    for order in orders:
        power = (float(moments[0, 0]) - float(taken[order - 1] if order else 0.0)) / used if order <= most else 0.0
        if power <= 0.0:
            break
        score = used * np.log(power) + order * np.log(used)
        if score < best_score - 1e-9:
            best, least, best_score = order, power, score
    taps = np.zeros(0)
    if best:
        taps = np.asarray(-np.linalg.solve(past[:best, :best], moments[0, 1 : best + 1]), dtype=np.float64)
    return Noise(taps, max(float(np.sqrt(least)), floor), max(rms, abs(mean)))


def bounded(noise: Noise, residuals: Sequence[Array], most: float) -> Noise:
    """Let a noise cost what it is larger than it may be: `most` is the rms that its slow part may have.

    What moves slowly is foretold row by row, so that to a free noise model a smooth misfit of any size is next to
    nothing. Its power is that of the residuals (q,) less that of the innovations; with the power held at `most` squared
    its n independent samples are less likely by n (x - 1 - log x) in -2 log likelihood, x the ratio of the two.
    `weight` squared is what a square adds to that, so that a fit sees it. What a model of p coefficients takes of white
    noise by chance, p of its n rows on average, is none of it, nor is what changes sides from row to row.
    """
    power, order = noise.rms**2 - noise.scale**2, len(noise.coefficients)
    by_chance = (order + _BY_CHANCE * np.sqrt(2.0 * order)) / sum(map(len, residuals))
    most = max(most, noise.scale * float(np.sqrt(by_chance)))
    if not power > most**2 or not np.isfinite(power) or (count := memory(residuals)) == 1.0:
        return noise
    ratio = power / most**2
    surplus = sum(map(len, residuals)) / count * (ratio - 1.0 - float(np.log(ratio)))
    return replace(noise, surplus=surplus, weight=float(np.sqrt((1.0 - 1.0 / ratio) / count)) / most)


def lagged_products(values: Array, most: int) -> Array:
    """Return sum over k >= most of v[k-i] v[k-j], (most + 1, most + 1): one row of sums, the others follow from it.

    Along a diagonal, each is the one before it, plus the product of rows that come in, less that of rows that go.
    """
    come, go = values[:most][::-1], values[len(values) - most :][::-1]
    later, rows, columns = _places(most)
    along = np.empty((2 * most + 1, most + 1))  # twice the row; the diagonal
    along[0] = [float(values[most:] @ values[most - lag : len(values) - lag]) for lag in range(most + 1)]
    along[1::2] = come[:, None] * np.append(come, 0.0)[later]
    along[2::2] = -go[:, None] * np.append(go, 0.0)[later]
    np.cumsum(along, axis=0, out=along)
    found = np.empty((most + 1, most + 1))
    found[rows, columns] = found[columns, rows] = along[2 * rows, columns - rows]
    return found


@cache
def _places(most: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the places (most, most + 1) of the rows that are as much later, and those (p,) of an upper triangle."""
    rows, columns = np.triu_indices(most + 1)
    return np.minimum(np.add.outer(np.arange(most), np.arange(most + 1)), most), rows, columns


def memory(residuals: Sequence[Array]) -> float:
    """Return how many rows of residuals (q,) count as one sample of their power: 1 + 2 sum rho^2 (Bartlett 1935).

    The sum goes over the lags up to where the autocorrelation of the longest part first is negative.
    """
    longest = max(residuals, key=len)
    size = 2 * len(longest)
    power = np.abs(np.fft.rfft(longest, size)) ** 2
    rho = np.fft.irfft(power, size)[: len(longest) // 2]
    rho = rho / max(float(rho[0]), 1e-300)
    below = np.flatnonzero(rho <= 0.0)
    kept = rho[1 : below[0]] if len(below) else rho[1:]
    return 1.0 + 2.0 * float(np.sum(kept**2))


def whiteness(innovations: Sequence[Array], lags: int) -> float:
    """Return the probability that white innovations (q,) would be this correlated (Ljung & Box 1978), least output."""
    from_each = [_ljung_box(values, lags) for values in innovations if len(values) > 4 * lags]
    return min(from_each, default=1.0)


def _ljung_box(values: Array, lags: int) -> float:
    from_mean = values - np.mean(values)
    power = float(from_mean @ from_mean)
    if power == 0.0:
        return 1.0
    count = len(values)
    shares = np.array([float(from_mean[lag:] @ from_mean[:-lag]) / power for lag in range(1, lags + 1)])
    statistic = count * (count + 2.0) * float(np.sum(shares**2 / (count - np.arange(1, lags + 1))))
    from_normal = (statistic / lags) ** (1.0 / 3.0) - (1.0 - 2.0 / (9.0 * lags))  # Wilson-Hilferty
    return float(0.5 * erfc(from_normal / np.sqrt(2.0 / (9.0 * lags)) / np.sqrt(2.0)))
