"""Linearize a plant at rest."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identify.assembly import ADD, FACTOR
from identify.engine import effect_simulator
from identify.marshal import at_point, job
from identify.plant import Plant
from identify.simulate import constants_of

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Linear:
    """dx/dt = a x + b u(t - delay), y = c x + d u(t - delay); continuous time, in the units of the plant's signals."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (r, n)
    d: Array  # (r, m)
    delay: float  # s


def linearize(plant: Plant) -> Linear:
    """Differentiate rate and reading at x = 0, u = 0 with the plant's parameter values.

    Of the effects stays what has a slope there: springs, couplings, lags, delays, gains. Friction, drops, limits and
    rounding have none and are left out, and so is a dead zone, beyond which the plant answers as if it were not there.
    """
    if plant.effects:
        return _with_effects(plant)
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    rate, reading = plant.rate(x, u, p), plant.reading(x, u, p)
    slopes = ca.Function(
        "slopes",
        [x, u, p],
        [ca.jacobian(rate, x), ca.jacobian(rate, u), ca.jacobian(reading, x), ca.jacobian(reading, u)],
    )
    constants = constants_of(plant)
    a, b, c, d = (np.array(slope) for slope in slopes(0.0, 0.0, constants))
    names = [parameter.name for parameter in plant.parameters]
    delay = float(constants[names.index(plant.delay)]) if plant.delay is not None else 0.0
    return Linear(a, b, c, d, delay)


_STRAIGHT = ("sensor_gain", "eccentric_angle", "eccentric_speed")
_QUICK = 1e7  # 1/s; a state that is faster has been put there for an algebraic equation


def _with_effects(plant: Plant) -> Linear:
    constants = constants_of(plant)
    engine = effect_simulator(plant)
    assembly = engine.assemble(constants)
    assembly.coordinates = []
    assembly.terms = [t for t in assembly.terms if t.what in (ADD, FACTOR) or t.code in _STRAIGHT]
    made = job(assembly, engine.equations, constants)
    n, m = len(assembly.a), assembly.inputs
    step = 1e-6
    rates, readings = [], []
    for index in range(n + m):
        ends = []
        for sign in (1.0, -1.0):
            point = np.zeros(n + m)
            point[index] = sign * step
            ends.append(at_point(made, point[:n], point[n:]))
        rates.append((ends[0][0] - ends[1][0]) / (2.0 * step))
        readings.append((ends[0][1] - ends[1][1]) / (2.0 * step))
    whole, read = np.array(rates).T, np.array(readings).T
    delay = made.delay + made.timing.input_delay + made.timing.output_delay.get(0, 0.0)
    return _reduced(Linear(whole[:, :n], whole[:, n:], read[:, :n], read[:, n:], delay))


def _reduced(full: Linear) -> Linear:
    """Solve for states that follow at once, and leave out those that no output can see."""
    quick = np.abs(np.diag(full.a)) > _QUICK
    seen = np.any(full.c != 0.0, axis=0)
    for _ in range(len(full.a)):
        seen = seen | np.any(full.a[seen] != 0.0, axis=0)
    slow, fast = np.flatnonzero(~quick & seen), np.flatnonzero(quick & seen)
    inner = np.linalg.inv(full.a[np.ix_(fast, fast)]) if len(fast) else np.zeros((0, 0))
    by_slow, by_input = -inner @ full.a[np.ix_(fast, slow)], -inner @ full.b[fast]
    return Linear(
        full.a[np.ix_(slow, slow)] + full.a[np.ix_(slow, fast)] @ by_slow,
        full.b[slow] + full.a[np.ix_(slow, fast)] @ by_input,
        full.c[:, slow] + full.c[:, fast] @ by_slow,
        full.d + full.c[:, fast] @ by_input,
        full.delay,
    )
