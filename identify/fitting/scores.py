"""Score a simulated signal against the measured one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Scores:
    """How well one output is predicted. `fit_percent` and `r2` are NaN where the measurement never moves."""

    fit_percent: float  # NRMSE fit, 100 (1 - |y - yhat| / |y - mean y|)
    rmse: float  # output's unit
    mae: float  # output's unit
    r2: float  # 1 - |y - yhat|^2 / |y - mean y|^2


def scores(measured: Array, simulated: Array) -> Scores:
    """Compare two signals (n,) of one unit."""
    miss = measured - simulated
    missed = float(np.sum(miss**2))
    moved = float(np.sum((measured - measured.mean()) ** 2))
    share = missed / moved if np.ptp(measured) > 0.0 else math.nan  # `moved` may be the rounding of its mean
    return Scores(
        fit_percent=100.0 * (1.0 - math.sqrt(share)),
        rmse=math.sqrt(missed / len(miss)),
        mae=float(np.mean(np.abs(miss))),
        r2=1.0 - share,
    )


@dataclass(frozen=True, slots=True)
class RecordingScore:
    """One recording against its simulation; scores are of the conditioned signals, `simulated` is not conditioned."""

    source: str
    scores: Mapping[str, Scores]  # by output
    simulated: Array  # (n, r)
    starts: Array  # (w, n) fitted initial state of each window; one where there are no windows
    lags: Mapping[str, float]  # s, by aligned output
