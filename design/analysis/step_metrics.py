"""Measure a step response: rise, settling, overshoot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from firmloop.design.analysis.loop import LAGS, Trajectory
from firmloop.design.law import DesignError

Array = npt.NDArray[np.float64]

TAIL = 10  # parts of a record, of which the last two tell how fast it still goes


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """Figures of one step response, relative to its first and last value.

    Times are in s from the step, infinite where the response does not get there. One that has not come to rest has no
    last value: there is nothing to have a share of.
    """

    rise_s: float  # 10 % to 90 %
    settling_2_s: float
    settling_5_s: float
    overshoot_percent: float
    undershoot_percent: float
    peak: float  # unit of the measurement
    steady_state_error: float  # reference less measurement at the end, unit of the measurement
    iae: float  # integral of |reference - measurement|, unit of the measurement times s


def step_metrics(trajectory: Trajectory, lag: float = 0.0) -> StepMetrics:
    """Measure the first step of the reference; 10 % and 90 % are interpolated between the samples.

    The first value is that at the step, the last one that of the last sample, and what is still to come where the
    record ends before the loop rests, whose slowest mode has the time constant `lag`, s. A response that enters its
    band only in the last twentieth of the record counts as not settled.
    """
    moved = np.flatnonzero(trajectory.reference != trajectory.reference[0])
    start = int(moved[0]) if len(moved) else 0
    time, y = trajectory.time[start:] - trajectory.time[start], trajectory.measurement[start:]
    if len(y) < 2:
        raise DesignError(f"the trajectory has {len(y)} samples after the step; run at least 2")
    error = trajectory.reference[start:] - y
    iae = float(np.sum(np.abs(error[:-1]) * np.diff(time)))
    span = y[-1] + _to_come(time, y, lag) - y[0]
    if span == 0:
        nothing = math.nan  # overshoots a response that does not come
        return StepMetrics(math.inf, math.inf, math.inf, nothing, nothing, float(y[-1]), float(error[-1]), iae)
    share = (y - y[0]) / span
    rests = math.isfinite(_settle(time, share, 0.05))
    return StepMetrics(
        rise_s=_reach(time, share, 0.9) - _reach(time, share, 0.1) if rests else math.inf,
        settling_2_s=_settle(time, share, 0.02),
        settling_5_s=_settle(time, share, 0.05),
        overshoot_percent=100 * max(0.0, float(share.max()) - 1) if rests else math.nan,
        undershoot_percent=100 * max(0.0, -float(share.min())) if rests else math.nan,
        peak=float(y[np.argmax(share)]),
        steady_state_error=float(error[-1]),
        iae=iae,
    )


def _to_come(time: Array, y: Array, lag: float) -> float:
    """Return what a slowest mode of time constant `lag`, s, still adds after the record: its speed times that."""
    part = len(y) // TAIL
    if part == 0 or time[-1] >= LAGS * lag:
        return 0.0
    before, after = float(np.mean(y[-2 * part : -part])), float(np.mean(y[-part:]))
    step = float(time[-1] - time[-1 - part])
    # Of r - c exp(-t/lag) the means of two neighbouring parts are so many times farther apart than its end is from r.
    times = math.expm1(step / lag) ** 2 * lag / step
    return (after - before) / times


def _reach(time: Array, share: Array, level: float) -> float:
    """Find the time at which `share` first passes `level`."""
    k = int(np.argmax(share >= level))
    return float(time[k - 1] + (time[k] - time[k - 1]) * (level - share[k - 1]) / (share[k] - share[k - 1]))


def _settle(time: Array, share: Array, band: float) -> float:
    """Find the time after which `share` stays within `band` of 1."""
    outside = np.flatnonzero(np.abs(share - 1) > band)
    k = int(outside[-1]) + 1
    if k > 0.95 * len(share):
        return math.inf
    return float(time[k])
