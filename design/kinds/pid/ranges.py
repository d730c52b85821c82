r"""Prove how far each state variable of a PID can go.

The equations and their symbols stand in `kind.py`. For all inputs within their ranges:

- D, where the controller keeps it. Let q = tf/(tf+h) (or Tustin's factor), g = kd/(tf+h) (or Tustin's), X the width of
  x's range. D[k] = g sum q^j
  (x[k-j] - x[k-j-1]). For 0 <= q < 1, summing by parts, D[k] = g (x[k] - a convex mean of earlier x), so |D| <= |g| X.
  For -1 < q < 0, |D| <= |g| X sum |q|^j = |g| X / (1 - |q|).
- f, where it keeps the filtered x instead: D = g (x - f), f[k+1] = q f + (1-q) x and f[0] = x[0]. For 0 <= q < 1, f is
  a convex mean of x. For -1 < q < 0, f is within (1-q)/(1-|q|) times half of X about the middle of x's range.
- I, back-calculation, upper bound, a = h/tt in (0, 1], w = v - I. Three cases:
  v > u_max: I+ = (1-a) I + a (u_max - w + ki h e / a). The tracking term lowers I, so I grows only where ki e > 0, and
  then at most to f(1/a), where f(s) = u_max - w + s ki h e.
  v within: I+ = I + ki h e grows only where ki e > 0, and I <= u_max - w, hence I+ <= f(1).
  v < u_min: I+ = (1-a) I + a (u_min - w + ki h e / a), at most the larger of I and g = u_min - w + ki h e / a.
  Hence I <= max(0, f(1), f(1/a) over all r, y, D with ki e >= 0, g over all r, y, D). These are linear in r, y, D, so
  their maxima stand at corners of the box or of its part with ki e >= 0.
- I, clamping, upper bound. I grows only while v <= u_max and ki e > 0; hence I <= max(0, f(1) where ki e >= 0).
- The lower bounds likewise, with all signs turned.
- I, no anti-windup: a constant error moves I without end.
- I, where u is not v within u_min and u_max alone (a rate limit, manual mode, an outside value that is tracked): u, or
  what stands in its place, keeps a range [t_min, t_max] by itself. Tracking then gives the convex combination
  I+ = (1-a) I + a (u - w + ki h e / a), manual mode I+ = u - w, clamping at most I+ = u - w + ki h e; hence
  I <= max(0, t_max - w + s ki h e) over all corners and s = 0, 1, 1/a.

A feedforward f, |f| <= F, adds to w: it moves both ends of I's range by F at most.

Ranges are widened by one percent, so that rounding cannot leave them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

from firmloop.design.law import DesignError
from firmloop.design.models.anti_windup import AntiWindup
from firmloop.design.models.pid_form import Discretization
from firmloop.identify.signal import Signal

WIDER = 0.01  # far above the rounding of any format that has the resolution to run the law at all


@dataclass(frozen=True, slots=True)
class Pid:
    """Every constant of one PID; the module docstring names them. Units: those of the wires, seconds."""

    period: float  # s
    kp: float
    ki: float
    kd: float
    tf: float  # s
    b: float
    c: float
    u_min: float
    u_max: float
    tracking: float  # h/tt; 0 without back-calculation
    anti_windup: AntiWindup
    form: Discretization
    rate: float = math.inf  # most that u moves, per s
    added: float = 0.0  # most that a feedforward adds to v, either way; it is no part of w above
    target: tuple[float, float] | None = None  # range of what I tracks where that is not u = v within its limits

    @property
    def integrates(self) -> bool:
        """Whether there is anything that could move the integral."""
        return self.ki != 0 or self.tracking != 0

    @property
    def differentiates(self) -> bool:
        """Whether there is a derivative."""
        return self.kd != 0

    @property
    def forget(self) -> float:
        """Factor of the previous D."""
        return float(self.form.forget(self.tf, self.period))

    @property
    def filters(self) -> bool:
        """Whether anything is left of the previous D."""
        return self.forget != 0

    @property
    def follow(self) -> float:
        """1 less `forget`: the share of x - f that f moves by."""
        return float(self.form.follow(self.tf, self.period))

    @property
    def slope(self) -> float:
        """Factor of x[k] - x[k-1]."""
        return float(self.form.slope(self.kd, self.tf, self.period))

    @property
    def half_step(self) -> float:
        """Factor of e[k] in the integral that acts at once: ki h/2 in Tustin's form, none in the default one."""
        return float(self.form.half_step(self.ki, self.period))


def state_ranges(
    pid: Pid, reference: Signal, measurement: Signal, output: Signal, varying: bool = False
) -> tuple[tuple[Signal, str], ...]:
    """List the state variables in the order of the law, each with its range and the argument for it.

    With constant factors the derivative's state is the filtered c r - y alone; with `varying` ones it is D and c r - y.
    """
    x_low, x_high = _span(pid.c * r - y for r, y in itertools.product(_ends(reference), _ends(measurement)))
    d_high = abs(pid.slope) * (x_high - x_low) / (1 - max(0.0, -pid.forget)) if pid.differentiates else 0.0
    found: list[tuple[Signal, str]] = []
    if pid.integrates:
        low, high = integral_range(pid, reference, measurement, d_high)
        why = (pid.anti_windup.why or NO_BOUND) if pid.target is None else TRACKED_WHY
        found.append((_widened("integral", output.unit, low - pid.added, high + pid.added), why))
    if pid.differentiates and varying:
        if pid.filters:
            found.append((_widened("derivative", output.unit, -d_high, d_high), DERIVATIVE_WHY))
        found.append((_widened("last", measurement.unit, x_low, x_high), LAST_WHY))
    elif pid.differentiates:
        q = max(0.0, -pid.forget)
        middle, half = (x_low + x_high) / 2, (x_high - x_low) / 2 * (1 + q) / (1 - q)
        found.append((_widened("filtered", measurement.unit, middle - half, middle + half), FILTERED_WHY))
    if pid.differentiates:
        found.append((Signal("started", "1", 0.0, 1.0), "0 before the first sample, 1 after it"))
    if math.isfinite(pid.rate):
        found.append((Signal("output_last", output.unit, pid.u_min, pid.u_max), "the output of the sample before"))
    for signal, _ in found:
        bounded = math.isfinite(signal.low) and math.isfinite(signal.high)
        if not bounded and not (signal.name == "integral" and not pid.anti_windup.why):
            raise DesignError(f"the pid's state '{signal.name}' would leave all numbers; give smaller gains or ranges")
    return tuple(found)


NO_BOUND = (
    "no bound: without anti-windup a constant error moves the integral without end; "
    'anti_windup = "clamping" or "back_calculation" limits it'
)
TRACKED_WHY = "it follows a value of known range less the rest of the output, plus ki tt times the error"
DERIVATIVE_WHY = "a gain times the distance of c r - y from a mean of its past, hence at most the gain times its range"
FILTERED_WHY = "a mean of c r - y over its past, hence within its range, or around it where the mean alternates"
LAST_WHY = "c r - y of the sample before, from the ranges of reference and measurement"


def integral_range(pid: Pid, reference: Signal, measurement: Signal, d_high: float) -> tuple[float, float]:
    """Find the extremes of f(1), f(1/a) and g of the module docstring, and of the start, 0; |D| <= `d_high`."""
    if not pid.anti_windup.why:
        return -math.inf, math.inf
    corners = list(itertools.product(_ends(reference), _ends(measurement)))
    meeting = max(reference.low, measurement.low), min(reference.high, measurement.high)
    if meeting[0] <= meeting[1]:
        corners += [(end, end) for end in meeting]  # where the line e = 0 leaves the box of r and y
    scales = (1.0, 1 / pid.tracking) if pid.tracking else (1.0,)
    if pid.target is not None:
        return _tracked_range(pid, corners, (0.0, *scales), d_high)
    low = high = 0.0
    for (r, y), d, scale in itertools.product(corners, (-d_high, d_high), scales):
        rest = pid.kp * (pid.b * r - y) + pid.half_step * (r - y) + d
        step = scale * pid.ki * pid.period * (r - y)
        tracked = pid.tracking != 0 and scale == scales[-1]
        if not math.isfinite(rest) or not math.isfinite(step):
            return -math.inf, math.inf
        if step >= 0 or tracked:
            high = max(high, (pid.u_max if step >= 0 else pid.u_min) - rest + step)
        if step <= 0 or tracked:
            low = min(low, (pid.u_min if step <= 0 else pid.u_max) - rest + step)
    return low, high


def _tracked_range(
    pid: Pid, corners: list[tuple[float, float]], scales: tuple[float, ...], d_high: float
) -> tuple[float, float]:
    """Find the extremes of t - w + s ki h e, t anywhere in its range."""
    assert pid.target is not None, "asked for only then"
    low = high = 0.0
    for (r, y), d, scale in itertools.product(corners, (-d_high, d_high), scales):
        rest = pid.kp * (pid.b * r - y) + pid.half_step * (r - y) + d
        step = scale * pid.ki * pid.period * (r - y)
        if not math.isfinite(rest) or not math.isfinite(step):
            return -math.inf, math.inf
        low, high = min(low, pid.target[0] - rest + step), max(high, pid.target[1] - rest + step)
    return low, high


def _ends(signal: Signal) -> tuple[float, float]:
    return signal.low, signal.high


def _span(values: Iterable[float]) -> tuple[float, float]:
    found = tuple(values)
    return min(found), max(found)


def _widened(name: str, unit: str, low: float, high: float) -> Signal:
    wider = WIDER * max(abs(low), abs(high)) or WIDER  # a state that never moves still needs a range
    return Signal(name, unit, low - wider, high + wider)
