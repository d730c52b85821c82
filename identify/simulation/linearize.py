"""Linearize a plant at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.assembly import ADD, FACTOR, EffectTerm
from firmloop.identify.plants.attach import placed, values_of, with_effects
from firmloop.identify.plants.effect import turning
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.engine import effect_simulator
from firmloop.identify.simulation.marshal import at_point, job
from firmloop.identify.simulation.simulate import constants_of

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
    A wave over the angle (gravity, cogging) is a spring only where the position is an output and the wave is no
    shorter than a turn; elsewhere the shaft goes through slopes of both signs, and their mean is zero.
    """
    found = _with_effects(plant) if plant.effects else _bare(plant)
    rows = np.vstack([np.hstack([found.a, found.b]), np.hstack([found.c, found.d])])
    if not np.all(np.isfinite(rows)):
        raise IdentifyError(_no_slope(plant, found))
    return found


def _no_slope(plant: Plant, found: Linear) -> str:
    """Say which equation has no finite slope at rest, and which value of 0 it may be divided by."""
    wrong = ~np.all(np.isfinite(np.hstack([found.a, found.b])), axis=1)
    named = [state.name for state, bad in zip(plant.states, wrong, strict=False) if bad]
    which = f"the derivative of {named[0]}" if named else "an output"
    zero = [parameter.name for parameter in plant.parameters if parameter.value == 0.0]
    cure = f"correct {' or '.join(zero)}, which is 0" if zero else "correct the equation or its parameters"
    return (
        f"plant.parameters: {which} has no finite slope with states and inputs at 0, as if it were divided by 0; {cure}"
    )


def bends(plant: Plant) -> str:
    """Name the state or output whose equation has other slopes elsewhere than at 0, effects apart; blank for none."""
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    forms = (*ca.vertsplit(plant.rate(x, u, p)), *ca.vertsplit(plant.reading(x, u, p)))
    place = ca.vertcat(x, u)
    bent = (ca.depends_on(ca.jacobian(form, place), place) for form in forms)
    return next(
        (each.name for each, is_bent in zip((*plant.states, *plant.outputs), bent, strict=False) if is_bent), ""
    )


def _bare(plant: Plant) -> Linear:
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


@dataclass(frozen=True, slots=True)
class Own:
    """A plant's linear part in its own states alone: `states` says which of them an output can see.

    `left_out` are effects with states of their own; a second body among them is put on the shaft as if it were rigid.
    """

    linear: Linear
    states: tuple[int, ...]
    left_out: tuple[str, ...]


def linearize_own(plant: Plant) -> Own:
    """Linearize, and leave out what brings states of its own; those of a position that only effects need count so."""
    bare = linearize(with_effects(plant, ())) if plant.effects else linearize(plant)
    seen = _seen(bare) if plant.effects else np.full(len(bare.a), True)
    states = tuple(int(k) for k in np.flatnonzero(seen))
    whole = linearize(plant)
    if len(whole.a) == len(states):
        return Own(whole, states, ())
    kept, left_out, share = [], [], 1.0
    for use, (_, site, own) in zip(plant.effects, placed(plant), strict=True):
        valued = replace(use, values=values_of(plant, use))
        if len(linearize(with_effects(plant, [valued])).a) == len(states):
            kept.append(valued)
            continue
        left_out.append(use.name)
        load = {plant.parameters[k].name.rpartition(".")[2]: plant.parameters[k].value for k in own}.get(site.load)
        if load is not None:
            nominal = constants_of(plant)[: plant.rate.numel_in(2)]
            share = 1.0 / (1.0 / share + load * float(plant.balances[site.balance].per(nominal)))
    linear = linearize(with_effects(plant, kept)) if kept else bare
    if not kept:
        linear = Linear(*_part(bare, seen), bare.delay)
    speeds = [k for k, row in enumerate(states) if row in {b.state for b in plant.balances if b.kind in _MOVES}]
    heavier = np.ones((len(states), 1))
    heavier[speeds[:1]] = share
    return Own(replace(linear, a=linear.a * heavier, b=linear.b * heavier), states, tuple(left_out))


_MOVES = ("torque", "force")
_QUICK = 1e7  # 1/s; a state that is faster has been put there for an algebraic equation
_NOTHING = 1e-12  # of the largest slope of its row: what a difference quotient makes of none


@cache
def _waves() -> frozenset[str]:
    """Return the functions of the library that follow the angle turn by turn."""
    return frozenset(name for effect in effects().values() for name, body in effect.codes if turning(body))


@cache
def _straight() -> frozenset[str]:
    """Return the functions of the library that change a reading but keep its slope at rest."""
    return frozenset(name for effect in effects().values() if effect.straight for name, _ in effect.codes)


def _has_slope(term: EffectTerm, reads_position: bool) -> bool:
    if term.code in _waves() and term.code not in _straight():
        return reads_position and term.rate[1] <= 1.0
    return term.what in (ADD, FACTOR) or term.code in _straight()


def _with_effects(plant: Plant) -> Linear:
    constants = constants_of(plant)
    engine = effect_simulator(plant)
    assembly = engine.assemble(constants)
    reads_position = assembly.position >= 0 and bool(np.any(assembly.read_x[:, assembly.position]))
    assembly.coordinates = []
    assembly.terms = [term for term in assembly.terms if _has_slope(term, reads_position)]
    made = job(assembly, engine.equations_at(constants), constants)
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
    whole[np.abs(whole) < _NOTHING * np.abs(whole).max(axis=1, keepdims=True)] = 0.0
    delay = made.delay + made.timing.input_delay + made.timing.output_delay.get(0, 0.0)
    return _reduced(Linear(whole[:, :n], whole[:, n:], read[:, :n], read[:, n:], delay))


def _seen(full: Linear) -> NDArray[np.bool_]:
    """Tell which states an output can see."""
    seen = np.asarray(np.any(full.c != 0.0, axis=0))
    for _ in range(len(full.a)):
        seen = seen | np.any(full.a[seen] != 0.0, axis=0)
    return seen


def _part(full: Linear, kept: NDArray[np.bool_]) -> tuple[Array, Array, Array, Array]:
    return full.a[np.ix_(kept, kept)], full.b[kept], full.c[:, kept], full.d


def _reduced(full: Linear) -> Linear:
    """Solve for states that follow at once, and leave out those that no output can see."""
    quick = np.abs(np.diag(full.a)) > _QUICK
    seen = _seen(full)
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
