"""Search the PID that minimizes an error integral of its own closed loop, within limits on Ms, noise and actuator.

The loop is run sample by sample as `kinds/pid.py` writes it, output limits and anti-windup included: a step of the
reference first, a step of the load at the plant's input in the second half. With e the error and t the time since the
last step, each summed over the samples::

    ISE = sum e^2 h        IAE = sum |e| h        ITAE = sum t |e| h

(F. G. Shinskey, Process Control Systems, 4th ed., 1996, chapter 4.) The sensitivity peak Ms and the noise gain, the rms
of the output over that of white noise on the measurement, are taken from the frequency response of the sampled loop.
A point that breaks a limit, or whose loop is not stable, is never the result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.discretize.zero_order_hold import state_space, zero_order_hold
from firmloop.design.law import DesignError
from firmloop.design.models.anti_windup import Sample, anti_windup_of
from firmloop.design.models.pid_form import form_of
from firmloop.design.models.process import Process
from firmloop.design.models.reaction import sampled_response
from firmloop.design.table import real
from firmloop.identify.simulation.linearize import Linear

Array = npt.NDArray[np.float64]
Response = npt.NDArray[np.complex128]

INSIDE = 0.995  # of a limit is what the search keeps to, so that a finer grid does not find it broken
EVALUATIONS = 150
SHORTEST, LONGEST = 150, 3000  # samples in each half of the run


@dataclass(frozen=True, slots=True)
class RobustnessLimits:
    """What every candidate must keep."""

    ms: float  # sensitivity peak
    noise_gain: float  # rms u over rms y, u/y


@dataclass(frozen=True, slots=True)
class Task:
    """One loop to be tuned: `step` of the reference in y, `load` at the plant's input in u."""

    linear: Linear
    period: float  # s
    table: Mapping[str, object]  # [controller]: form, filter, weights, limits and anti-windup
    u_min: float
    u_max: float
    step: float
    load: float
    samples: int  # of each half


GainTriple = tuple[float, float, float]  # kp, ki, kd
Cost = Callable[[ca.SX, ca.SX], ca.SX]  # (error, time since the step) -> what a sample adds


def run_length(model: Process, period: float) -> int:
    """Return how many samples the loop is given to settle: 12 of its own time constants and 2 of the plant's."""
    lag = max(model.lags, default=0.0)
    own = model.delay + (min(lag, 8 * model.delay) if lag else 8 * model.delay)
    return int(np.clip((12 * own + 2 * lag) / period, SHORTEST, LONGEST))


def search(task: Task, cost: Cost, limits: RobustnessLimits, starts: tuple[GainTriple, ...]) -> GainTriple:
    """Return the gains of least cost found from the first of `starts` that keeps the limits.

    Raises
    ------
    DesignError
        when none of them does.
    """
    run, check = _run(task, cost), _Check(task, limits)
    begin = next((point for point in starts if check.excess(point) <= 0 and check.stable(point)), None)
    if begin is None:
        raise DesignError(
            f"no PID was found that keeps ms_max = {limits.ms:g}"
            + (f" and noise_gain_max = {limits.noise_gain:g}" if math.isfinite(limits.noise_gain) else "")
            + "; allow more of them, or give tf_s"
        )
    best, least = begin, run(begin)
    signs = [math.copysign(1.0, gain) for gain in begin]
    free = [k for k in range(3) if begin[k] != 0]

    def point_at(place: Array) -> GainTriple:
        made = [0.0, 0.0, 0.0]
        for k, value in zip(free, place, strict=True):
            made[k] = signs[k] * math.exp(float(np.clip(value, -60, 60)))
        return made[0], made[1], made[2]

    def objective(place: Array) -> float:
        nonlocal best, least
        point = point_at(place)
        excess = check.excess(point)
        if excess > 0:
            return 1e6 * (1 + min(excess, 1e6)) * scale
        value = run(point)
        if value < least:
            if not check.stable(point):
                return 1e13 * scale
            best, least = point, value
        return value if math.isfinite(value) else 1e13 * scale

    scale = max(least, 1e-300)
    for turn in range(2):  # Nelder and Mead stall at a limit; a fresh simplex goes along it
        place = np.log(np.abs([best[k] for k in free]))
        simplex = np.vstack([place, place + (0.35 / 2**turn) * np.eye(len(free)) * (1 if turn % 2 == 0 else -1)])
        scipy.optimize.minimize(
            objective,
            place,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": EVALUATIONS, "xatol": 1e-4, "fatol": 1e-7 * scale},
        )
    return best


def filter_time(table: Mapping[str, object], point: GainTriple) -> float:
    """Time constant of the derivative's filter, s: the table's or Td/10, as `kinds/pid/kind.py` chooses it."""
    kp, _, kd = point
    return real(table, "tf_s", abs(kd / kp) / 10 if kp else 0.0, 0.0)


class _Check:
    """Whether a point keeps the limits, from the frequency response."""

    def __init__(self, task: Task, limits: RobustnessLimits) -> None:
        self._task, self._limits = task, limits
        top = math.pi / task.period
        speeds = np.abs(np.linalg.eigvals(np.atleast_2d(task.linear.a)))
        slow = min(float(speeds[speeds > 1e-9 * top].min(initial=top)), top)
        self._even = (np.arange(400) + 0.5) * top / 400
        grid = np.concatenate([np.geomspace(1e-2 * slow, top, 700), self._even])
        self._z = np.exp(1j * grid * task.period)
        self._plant = sampled_response(task.linear, task.period)(grid)
        self._abc = state_space(zero_order_hold(task.linear, task.period))

    def excess(self, point: GainTriple) -> float:
        """By which share the worst limit is broken; at most 0 where all are kept."""
        own = controller_response(self._task.table, point, self._task.period, self._z)
        with np.errstate(all="ignore"):
            sensitivity = 1 / (1 + own * self._plant)
            ms = float(np.max(np.abs(sensitivity)))
            noise = math.sqrt(float(np.mean(np.abs((own * sensitivity)[-len(self._even) :]) ** 2)))
        worst = max(ms / self._limits.ms, noise / self._limits.noise_gain) / INSIDE - 1
        return worst if math.isfinite(worst) else math.inf

    def stable(self, point: GainTriple) -> bool:
        """Whether every pole of the loop lies inside the unit circle."""
        a, b, c = self._abc
        f, g, k, d = _controller(self._task.table, point, self._task.period)
        ring = np.block([[a - b[:, :1] * d @ c[:1], b[:, :1] @ k], [-g @ c[:1], f]])
        return bool(np.max(np.abs(np.linalg.eigvals(ring))) < 1 - 1e-9)


def controller_response(table: Mapping[str, object], point: GainTriple, period: float, z: Response) -> Response:
    """Return u/e (n,) of the PID at points z (n,)."""
    f, g, k, d = _controller(table, point, period)
    (integral, forget), (in_integral, in_filter) = np.diag(f), g[:, 0]
    return np.asarray(d[0, 0] + k[0, 0] * in_integral / (z - integral) + k[0, 1] * in_filter / (z - forget))


def _controller(table: Mapping[str, object], point: GainTriple, h: float) -> tuple[Array, Array, Array, Array]:
    """Write e -> u as x+ = f x + g e, u = k x + d e; the derivative's slope/(1) (z - 1)/(z - forget) is split up."""
    kp, ki, kd = point
    tf = filter_time(table, point)
    rule = form_of(table).rule
    forget, slope = rule.forget(tf, h), rule.slope(kd, tf, h)
    direct = kp + slope + rule.half_step(ki, h)
    return (
        np.diag([1.0, forget]),
        np.array([[ki * h], [1.0]]),
        np.array([[1.0, slope * (forget - 1)]]),
        np.array([[direct]]),
    )


def _run(task: Task, cost: Cost) -> Callable[[GainTriple], float]:
    """Build the loop with symbolic gains; the function returned runs it once."""
    table, h = task.table, task.period
    a, b, c = (ca.sparsify(ca.DM(part)) for part in state_space(zero_order_hold(task.linear, h)))
    plant, held = ca.SX.sym("plant", a.shape[0]), ca.SX.sym("held", 3)
    drive, gains = ca.SX.sym("drive", 3), ca.SX.sym("gains", 5)  # reference, load, time; kp, ki, kd, tf, h/tt
    reference, load, time = ca.vertsplit(drive)
    kp, ki, kd, tf, tracking = ca.vertsplit(gains)
    integral, derivative, last = ca.vertsplit(held)
    rule, windup = form_of(table).rule, anti_windup_of(table)
    y = (c @ plant)[0]
    e, x = reference - y, real(table, "c", 0.0) * reference - y
    rate = rule.forget(tf, h) * derivative + rule.slope(kd, tf, h) * (x - last)
    v = kp * (real(table, "b", 1.0) * reference - y) + integral + rate + rule.half_step(ki, h) * e
    u = ca.fmin(ca.fmax(v, task.u_min), task.u_max)
    above, below = v > task.u_max, v < task.u_min
    grown = windup.moved(Sample(integral, ki * h * e, tracking * (u - v), above, below, ki * e > 0, ki * e < 0))
    step = ca.Function(
        "step",
        [ca.vertcat(plant, held), drive, gains],
        [ca.vertcat(a @ plant + b[:, 0] * (u + load), grown, rate, x), cost(e, time) * h],
    )
    n = task.samples
    whole = step.mapaccum(2 * n)
    rows = np.zeros((3, 2 * n))
    rows[0], rows[1, n:], rows[2] = task.step, task.load, np.tile(np.arange(n) * h, 2)
    start = np.zeros(a.shape[0] + 3)
    start[-1] = real(table, "c", 0.0) * task.step  # D is 0 at the first sample

    def run(point: GainTriple) -> float:
        one, two, three = point
        tt = real(table, "tt_s", 0.0)
        if not tt:
            usual = (math.sqrt(abs(three / two)) if three else abs(one / two)) if two else math.inf
            tt = max(usual, h)
        values = np.array([*point, filter_time(table, point), h / tt if windup.tracks else 0.0])
        _, added = whole(start, rows, values.reshape(-1, 1) @ np.ones((1, 2 * n)))
        return float(np.sum(np.array(added)))

    return run
