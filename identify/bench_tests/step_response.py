"""Find the step in a recording, and measure the response to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import Recording, column

Array = NDArray[np.float64]

LAST = 0.15  # share of the response that its final value is the mean of
FEWEST = 10  # rows after the step that a response is measured from
STEADY = 0.005  # share of the input's step within which it counts as held
CLEAR = 0.25  # of the change: how well a drift at the end has to be known
CERTAIN = 0.001  # chance below which a response is said to drift still
LIKELY = 0.05  # and where twice as many rows say so, too


@dataclass(frozen=True, slots=True)
class StepResponse:
    """One response, from the step on: `time` (n,) in s from the step, `output` (n,) as recorded."""

    source: str
    time: Array
    output: Array
    drive: tuple[float, float]  # input before and after
    start: float  # output before the step
    final: float  # output at the end, the mean of the last part
    noise: float  # rms around a smooth curve
    unit: str
    before: int  # rows that `start` is the mean of

    @property
    def gain(self) -> float:
        """Change of the output per change of the input."""
        return (self.final - self.start) / (self.drive[1] - self.drive[0])

    @property
    def share(self) -> Array:
        """Output as a share of its whole change (n,): 0 before, 1 at the end."""
        return np.asarray((self.output - self.start) / (self.final - self.start))


@dataclass(frozen=True, slots=True)
class StepFigures:
    """Figures of one response; times in s from the step, infinite where the response does not get there."""

    gain: float
    rise_s: float  # 10 to 90 %
    settling_2_s: float
    settling_5_s: float
    overshoot_percent: float
    peak_s: float
    steady_state_error: float  # what was expected less the final value; NaN where nothing was
    final: float


def step_response(recording: Recording, drive: str, output: str) -> StepResponse:
    """Cut the first step out of a recording.

    Raises
    ------
    IdentifyError
        when the input never steps, does not stay, the response is too short, does not come, or has not settled.
    """
    time, u, y = recording.time, column(recording, drive), column(recording, output)
    where = f"{recording.source}: "
    span = float(np.ptp(u))
    if span == 0.0:
        raise IdentifyError(f"{where}the step never comes: {drive} is {u[0]:g} in every row; record one step of it")
    moved = np.flatnonzero(np.abs(u - u[0]) > STEADY * span)
    first = int(moved[0])
    held = np.abs(u[first:] - u[first]) <= STEADY * span
    end = first + (int(np.argmin(held)) if not held.all() else len(held))
    if end - first < FEWEST:
        raise IdentifyError(
            f"{where}{drive} is no step: it stays for {end - first} rows after row {first}; hold it until the output "
            f"has settled, at least {FEWEST} rows (for other signals use identify)"
        )
    unit = next(signal.unit for signal in recording.signals if signal.name == output)
    response, moment = y[first:end], time[first:end] - time[first]
    start = float(np.mean(y[: first + 1])) if first else float(y[0])
    smooth = _smoothed(response)
    noise = float(np.std(np.diff(response, 2))) / math.sqrt(6.0)  # white noise passes a second difference sqrt(6) fold
    last = _last(response)
    tail, tail_time = response[-last:], moment[-last:]
    final = float(np.mean(tail))
    change = final - start
    if abs(change) < 4.0 * noise / math.sqrt(last) or change == 0.0:
        raise IdentifyError(
            f"{where}{output} does not answer the step of {drive} from {u[0]:g} to {u[first]:g}: it moves by "
            f"{change:.2g} {unit} in noise of {noise:.2g} {unit}; check the wiring or make the step larger"
        )
    fitted = scipy.stats.linregress(tail_time, tail)
    swing = float(np.ptp(smooth[-last:] - fitted.slope * tail_time))
    # Where nothing was smoothed: as far apart as the extremes of so many rows of Gaussian noise come.
    extremes = 4.0 if _window(response) else 1.0 + 2.0 * math.sqrt(2.0 * math.log(last))
    if swing > 0.1 * abs(change) + extremes * noise:
        raise IdentifyError(
            f"{where}the response never settles: in its last {tail_time[-1] - tail_time[0]:.3g} s {output} still "
            f"swings by {swing:.2g} {unit}, {100 * swing / abs(change):.0f} % of its change; record longer"
        )
    unsure = 2.0 * math.sqrt(12.0 / last) * noise / abs(change)  # of a straight line through the last rows
    if unsure > CLEAR:
        raise IdentifyError(
            f"{where}{len(response)} rows after the step are too short to tell whether {output} has settled: what it "
            f"drifts in the last {last} of them is known to {100 * unsure:.0f} % of its change, at most "
            f"{100 * CLEAR:.0f} % would do; record longer, or with less noise"
        )
    drift = float(fitted.slope) * float(tail_time[-1] - tail_time[0])
    clear = (
        noise == 0.0 or fitted.pvalue < CERTAIN or (fitted.pvalue < LIKELY and _drifts(response, moment, fitted.slope))
    )
    if clear and abs(drift) > 0.02 * abs(change):
        raise IdentifyError(
            f"{where}the response never settles: in its last {tail_time[-1] - tail_time[0]:.3g} s {output} still moves "
            f"by {abs(drift):.2g} {unit}, {100 * abs(drift / change):.0f} % of its change; record longer, or fit a "
            "plant that integrates"
        )
    return StepResponse(
        recording.source, moment, response, (float(u[0]), float(u[first])), start, final, noise, unit, first + 1
    )


def _drifts(response: Array, moment: Array, slope: float) -> bool:
    """Tell whether a response drifts in twice as many rows as its final value is the mean of, and the same way."""
    rows = 2 * _last(response)
    wide = scipy.stats.linregress(moment[-rows:], response[-rows:])
    return bool(wide.pvalue < CERTAIN and wide.slope * slope > 0.0)


def redrawn(response: StepResponse, random: np.random.Generator) -> StepResponse:
    """Draw the response anew: its smooth curve with as much white noise as it has."""
    output = _smoothed(response.output) + random.normal(0.0, response.noise, len(response.output))
    start = response.start + float(random.normal(0.0, response.noise / math.sqrt(response.before)))
    return replace(response, output=output, start=start, final=float(np.mean(output[-_last(output) :])))


def step_figures(response: StepResponse, expected: float = math.nan) -> StepFigures:
    """Measure a response; `expected` is the final value that was asked for.

    The curve is smoothed first (quadratic Savitzky-Golay over a fifth of the rise), so that noise does not count as
    overshoot; settling bands are widened by what noise is left.
    """
    time, share = response.time, _smoothed(response.share)
    # What a quadratic Savitzky-Golay filter over n rows leaves of white noise: sqrt(9/(4 n)) of it.
    left = 1.5 / math.sqrt(_window(response.share) or 2.25)
    blur = left * response.noise / abs(response.final - response.start)
    peak = int(np.argmax(share))
    over = float(share[peak]) - 1.0
    return StepFigures(
        gain=response.gain,
        rise_s=reach(time, share, 0.9) - reach(time, share, 0.1),
        settling_2_s=_settle(time, share, 0.02 + 3 * blur),
        settling_5_s=_settle(time, share, 0.05 + 3 * blur),
        overshoot_percent=100.0 * over if over > 4 * blur and peak < 0.9 * len(share) else 0.0,
        peak_s=float(time[peak]),
        steady_state_error=expected - response.final,
        final=response.final,
    )


def reach(time: Array, share: Array, level: float) -> float:
    """Return when `share` first passes `level`, interpolated; infinite where it never does."""
    above = np.flatnonzero(share >= level)
    if not len(above):
        return math.inf
    k = int(above[0])
    if k == 0:
        return float(time[0])
    return float(time[k - 1] + (time[k] - time[k - 1]) * (level - share[k - 1]) / (share[k] - share[k - 1]))


def _last(response: Array) -> int:
    """Rows that a final value is the mean of."""
    return max(int(LAST * len(response)), 3)


def smooth_share(response: StepResponse) -> Array:
    """Return the response as a share of its change (n,), smoothed for reading points off it."""
    return _smoothed(response.share)


def _settle(time: Array, share: Array, band: float) -> float:
    outside = np.flatnonzero(np.abs(share - 1.0) > band)
    k = int(outside[-1]) + 1 if len(outside) else 0
    return float(time[k]) if k < 0.97 * len(share) else math.inf


def _window(curve: Array) -> int:
    """Rows of the smoothing window: a fifth of those between a tenth and nine tenths of the way; 0 for none."""
    low, high = curve[0], np.mean(curve[-max(len(curve) // 8, 3) :])
    way = (curve - low) / (high - low) if high != low else np.zeros_like(curve)
    rising = int(np.argmax(way >= 0.9)) - int(np.argmax(way >= 0.1))
    window = max(rising, 0) // 5 | 1
    return window if 5 <= window <= len(curve) else 0


def _smoothed(curve: Array) -> Array:
    window = _window(curve)
    return np.asarray(scipy.signal.savgol_filter(curve, window, 2)) if window else curve
