"""Test what a fit leaves over: whether it is white, and whether the input has nothing more to say about it.

L. Ljung, System Identification (1999), section 16.6. With N residuals e and their autocorrelation r(k): Ljung and Box's
Q = N (N + 2) sum r(k)^2/(N - k) is chi-squared with as many degrees as lags where e is white (Biometrika 65 (1978)
297-303). The cross-correlation of e with the input u at lag k has the variance sum R_e(j) R_u(j)/N where the two are
independent; its largest value over the lags is judged at 5 % in all (Sidak's correction).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_LAGS = 25
POOR = 0.75  # of an output's variance: less is a fit below 50 %
MEMORY = 1.0  # von Neumann's ratio, 2 for white noise
DOUBTED = 0.01  # of all right models may be called wrong
CERTAIN = 0.05  # a test fails where so small a chance would have to be believed in


@dataclass(frozen=True, slots=True)
class ResidualTests:
    """`whiteness` and `independence` are the chances of residuals at least so regular where the model is right."""

    lags: int
    whiteness: float
    independence: float
    bias: float  # chance of a mean at least so far from 0
    worst_lag: int  # samples by which the input comes before what it still explains
    answering: float = 0.0  # share of the residuals that input and motion explain beyond chance, by checks/structure.py

    @property
    def white(self) -> bool:
        """Whether nothing is left in the residual's own past."""
        return self.whiteness >= CERTAIN

    @property
    def independent(self) -> bool:
        """Whether nothing of the input is left."""
        return self.independence >= CERTAIN

    @property
    def explained(self) -> bool:
        """Whether both tests together leave more than a chance of DOUBTED."""
        return _likely(min(self.whiteness, self.independence))

    @property
    def answers_nothing(self) -> bool:
        """Whether those tests that reckon with the residual's own memory see nothing of input and motion in it."""
        return _likely(self.independence) and self.answering == 0.0


def _likely(chance: float) -> bool:
    """Tell whether the lesser chance of two tests is one that a right model has."""
    return 1.0 - (1.0 - chance) ** 2 >= DOUBTED


def residual_tests(residual: Array, drive: Array) -> ResidualTests:
    """Test residuals (n,) against the input (n,) of the same rows."""
    e, u = residual - residual.mean(), drive - drive.mean()
    rows = len(e)
    lags = max(1, min(MOST_LAGS, rows // 4))
    power = float(e @ e)
    if power == 0.0:
        return ResidualTests(lags, 1.0, 1.0, 1.0, 0)
    own = np.array([float(e[k:] @ e[: rows - k]) / power for k in range(1, lags + 1)])
    q = rows * (rows + 2) * float(np.sum(own**2 / (rows - np.arange(1, lags + 1))))
    whiteness = float(scipy.special.chdtrc(lags, q))
    spread = float(residual.std(ddof=1)) / math.sqrt(rows)
    long_run = spread * math.sqrt(max(1.0 + 2.0 * float(np.sum(own)), 0.1))
    bias = float(2 * scipy.special.ndtr(-abs(float(residual.mean())) / long_run))
    independence, worst = _independence(e, u, lags)
    return ResidualTests(lags, whiteness, independence, bias, worst)


def slow(residual: Array) -> bool:
    """Tell whether residuals (n,) move slowly, by von Neumann's ratio, as noise of a sensor does not."""
    return float(np.sum(np.diff(residual) ** 2)) < MEMORY * float(residual @ residual)


def independent(residuals: Sequence[Array]) -> float:
    """Return how many independent samples residuals (q,) of several recordings hold: q / (1 + 2 sum rho)."""
    count = 0.0
    for part in residuals:
        rows = len(part)
        power = np.abs(np.fft.rfft(part - part.mean(), 2 * rows)) ** 2
        rho = np.fft.irfft(power, 2 * rows)[: max(rows // 2, 1)]
        if rho[0] <= 0.0:
            continue
        rho = rho / rho[0]
        below = np.flatnonzero(rho <= 0.0)
        kept = rho[1 : below[0]] if len(below) else rho[1:]
        count += rows / (1.0 + 2.0 * float(np.sum(kept)))
    return count


def likelier(before: Mapping[str, float], after: Mapping[str, float], left: Sequence[Array]) -> float:
    """Return by how much twice the log likelihood rises where the noise of outputs falls from `before` to `after`.

    It is counted in independent samples of what is `left` (q, r) then of each recording, the outputs as in `after`.
    """
    rises = (
        independent([part[:, k] for part in left]) * math.log(max(before[name], 1e-300) / max(noise, 1e-300))
        for k, (name, noise) in enumerate(after.items())
    )
    return 2.0 * sum(rises)


def unexplained(kind: str, source: str, output: str, residual: Array, r2: float) -> tuple[str, ...]:
    """Say where a model leaves much of an output (r2 of it explained) in residuals (n,) that are no noise."""
    if not r2 < POOR or not slow(residual):
        return ()
    return (
        f"{kind} explains only {100.0 * max(r2, 0.0):.2g} % of the variance of {output} in {source}, and what is left "
        "is no noise: its intervals mean little; try another kind, or let diagnose say what is missing",
    )


def _independence(e: Array, u: Array, lags: int) -> tuple[float, int]:
    """Chance of the largest cross-correlation for lags 0 to `lags`, and that lag."""
    rows = len(e)
    if not np.any(u):
        return 1.0, 0
    reach = min(4 * lags, rows // 4)
    own = [(float(e[k:] @ e[: rows - k]) / rows, float(u[k:] @ u[: rows - k]) / rows) for k in range(reach + 1)]
    variance = own[0][0] * own[0][1] + 2 * sum(a * b for a, b in own[1:])
    variance = max(variance, 0.05 * own[0][0] * own[0][1]) / rows
    cross = np.array([float(e[k:] @ u[: rows - k]) / rows for k in range(lags + 1)]) / math.sqrt(variance)
    worst = int(np.argmax(np.abs(cross)))
    single = float(2 * scipy.special.ndtr(-abs(cross[worst])))
    return 1.0 - (1.0 - single) ** (lags + 1), worst
