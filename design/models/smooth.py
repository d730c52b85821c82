"""The equations of a plant as a predictive controller needs them: with their effects, smooth, and sampled.

Every effect says itself what holds a plant against it (`holding` in identify/plants/effects); the equations get the
opposite of that, with s(w) = tanh(w/smooth) in place of the sign of the speed w, where it jumps::

    dry friction            -Tp (1 + s(w))/2 + Tn (1 - s(w))/2;   -T s(w) where both are one T
    Stribeck                -(Tc + (Ts - Tc) exp(-(w/ws)^2)) s(w)
    load, drag              -T - c w^2 s(w)
    gravity, cogging        -T sin(n theta + phi)
    springs                 -k theta - k3 theta^3

Others (delays, sensors, backlash, what depends on the load) are left out; the law's first line names them. Sampling
is the Runge-Kutta method of order four with its slopes carried along (internal differentiation: Bock, 1981).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from firmloop.design.law import DesignError, Law, Scalar
from firmloop.identify.plants.attach import label_of, placed
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.simulate import constants_of

LONGEST = 1.0  # of one Runge-Kutta step, over the fastest eigenvalue's magnitude
MOST_PARTS = 10  # of one sample: what every sample computes


@dataclass(frozen=True, slots=True)
class Smooth:
    """dx/dt = rate(x (n,), u (m,)); `missed` names the effects that it leaves out."""

    rate: ca.Function
    states: tuple[Signal, ...]
    missed: tuple[str, ...]


def smooth_rate(plant: Plant, smooth: float) -> Smooth:
    """Write the plant's equations with its numbers and the effects above; `smooth` in the unit of the speed."""
    x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u", len(plant.inputs))
    constants = ca.DM(constants_of(plant)[: plant.rate.numel_in(2)])
    rate = plant.rate(x, u, constants)
    missed = []
    place = next((balance for balance in plant.balances if balance.kind in ("torque", "force")), None)
    for use, (effect, site, at) in zip(plant.effects, placed(plant), strict=True):
        held = None
        if effect.holding is not None and effect.place == "torque":
            held = effect.holding(site, tuple(plant.parameters[k].value for k in at))
        if held is None or held.share or place is None or place.state < 0:
            missed.append(label_of(plant, use))
            continue
        rate[place.state] += place.per(constants) * held.effort(*_motion(x, place, smooth))
    if plant.delay is not None:
        missed.append(plant.delay)
    return Smooth(ca.Function("rate", [x, u], [rate]), plant.states, tuple(missed))


def _motion(x: ca.SX, place: Balance, smooth: float) -> tuple[ca.SX, ca.SX, ca.SX]:
    speed = x[place.state]
    return speed, ca.tanh(speed / smooth), x[place.position] if place.position >= 0 else ca.SX(0)


def parts_of(plant: Smooth, period: float, points: np.ndarray) -> int:
    """Choose the Runge-Kutta steps of one sample from the fastest eigenvalue at `points` (k, n)."""
    n, m = plant.rate.numel_in(0), plant.rate.numel_in(1)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    slope = ca.Function("slope", [x, u], [ca.jacobian(plant.rate(x, u), x)])
    found = [np.asarray(slope(point, 0)) for point in points]
    fastest = max(float(np.max(np.abs(np.linalg.eigvals(a)))) for a in found if np.all(np.isfinite(a)))
    parts = max(1, math.ceil(period * fastest / LONGEST))
    if parts > MOST_PARTS:
        raise DesignError(
            f"the plant's fastest eigenvalue is {fastest:.3g} 1/s, too fast for controller.period_s = {period:g} "
            f"({parts} Runge-Kutta steps a sample, at most {MOST_PARTS}); leave the fast part out of the plant "
            "(L_H = 0), raise controller.smooth, or give a shorter period"
        )
    return parts


def sampled(plant: Smooth, inputs: tuple[Signal, ...], period: float, parts: int) -> Law:
    """Return the law without state from x and u to x one period later and its slopes by both, row by row."""
    n, m = plant.rate.numel_in(0), plant.rate.numel_in(1)
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    rate = plant.rate(x, u)
    slopes = ca.Function("slopes", [x, u], [rate, ca.jacobian(rate, x), ca.jacobian(rate, u)])
    h, now, by = period / parts, x, ca.horzcat(ca.SX.eye(n), ca.SX(n, m))
    for _ in range(parts):
        total, total_by, ahead, ahead_by = ca.SX.zeros(n), ca.SX(n, n + m), now, by
        for weight, reach in ((1, 0.5), (2, 0.5), (2, 1.0), (1, 0.0)):
            k, by_x, by_u = slopes(ahead, u)
            k_by = by_x @ ahead_by + ca.horzcat(ca.SX(n, n), by_u)
            total, total_by = total + weight * k, total_by + weight * k_by
            ahead, ahead_by = now + reach * h * k, by + reach * h * k_by
        now, by = now + h / 6 * total, by + h / 6 * total_by
    found = ca.vertcat(now, ca.vec(ca.densify(by).T))
    (found,) = ca.cse([ca.densify(found)])
    names = [f"x_{k + 1}" for k in range(n)]
    wide = [Signal(name, state.unit, -math.inf, math.inf) for name, state in zip(names, plant.states, strict=True)]
    pushed = [Signal(f"u_{k + 1}", wire.unit, -math.inf, math.inf) for k, wire in enumerate(inputs)]
    outputs = [f"{name}_next" for name in names] + [f"slope_{i + 1}_{j + 1}" for i in range(n) for j in range(n + m)]
    none = ca.SX(0, 1)
    function = ca.Function("model", [none, ca.vertcat(x, u)], [none, found, none, none])
    return Law(
        name="model",
        says=f"the plant over one sample of {period:g} s ({parts} Runge-Kutta step{'s' if parts > 1 else ''}), "
        "and its slopes by x and u, row by row",
        period=period,
        inputs=(*wide, *pushed),
        outputs=tuple(Signal(name, "", -math.inf, math.inf) for name in outputs),
        state=(),
        start=(),
        why=(),
        flags=(),
        stages=(Scalar(function, ()),),
    )
