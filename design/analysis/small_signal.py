"""Linearize a law where none of its limits acts."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.design.law import DesignError, Law, Quadratic
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

NUDGE = 1e-6  # share of a range by which a point is moved to see whether it stands at an edge of the law
SAME = 1e-4  # share by which a Jacobian may change in such a move: a schedule's does, an edge changes it wholly
SAMPLES = 64  # samples in which a law is expected to leave its start


class NeverFreeError(DesignError):
    """A law whose limits act wherever it was looked at; what it drives may say why."""


@dataclass(frozen=True, slots=True)
class LinearLaw:
    """x[k+1] = a x[k] + b z[k], u[k] = c x[k] + d z[k], without the state that no input reaches."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (r, n)
    d: Array  # (r, m)


@lru_cache(maxsize=16)
def linearize_law(law: Law) -> LinearLaw:
    """Jacobians of the law at a point where no flag is raised and no small move changes them.

    The point is sought on trajectories with small constant errors, both signs, from the law's start. Kept, because the
    figures of a loop ask for it for each end of a parameter's interval.
    """
    jacobian = _jacobian(law)
    for x, z in _points(law):
        found = _smooth(law, jacobian, x, z)
        if found is not None:
            n = len(law.state)
            a, b, c, d = found[:n, :n], found[:n, n:], found[n:, :n], found[n:, n:]
            reached = _reached(a, b)
            return LinearLaw(a[np.ix_(reached, reached)], b[reached], c[:, reached], d)
    stands = f"law '{law.name}' stands at a limit at every point tried"
    if all(_hardly_moves(law, index) for index in range(len(law.outputs))):
        raise NeverFreeError(
            f"{stands}: within the ranges of [signals] it moves its output by less than a millionth of its range; "
            "raise its gains"
        )
    raise NeverFreeError(
        f"{stands}, from a millionth of the range off: lower its gains, as a longer period_s or a slower tuning does, "
        "or widen u_min and u_max or the ranges in [signals]"
    )


def _hardly_moves(law: Law, index: int) -> bool:
    """Tell whether an output stays where it is wherever the law is looked at, but for a nudge."""
    step, wire = sample(law), law.outputs[index]
    seen = [float(step(x, z)[1][index]) for x, z in _points(law)]
    return max(seen) - min(seen) < NUDGE * (wire.high - wire.low)


def sample(law: Law) -> ca.Function:
    """One sample of the law: (x, z) -> (x_next, u, flags)."""
    x, z = ca.SX.sym("x", len(law.state)), ca.SX.sym("z", len(law.inputs))
    x_next, u, flags, _ = law.last.function(x, z, *_moves(law, x, z))
    return ca.Function("sample", [x, z], [x_next, u, flags])


def _moves(law: Law, x: ca.SX, z: ca.SX) -> tuple[ca.SX, ...]:
    """Return what a stage before the last hands to it where none of its limits acts."""
    if law.solve is None:
        return ()
    problem = law.solve.problem
    if not isinstance(problem, Quadratic):
        raise DesignError(f"law '{law.name}' follows the plant's own equations, which no linear law stands for")
    free = ca.SX(problem.slope[: len(problem.scale)]) @ law.solve.function(x, z)
    moves: ca.SX = ca.vertcat(ca.SX(problem.scale) * free, ca.SX(2, 1))
    return (moves,)


def _jacobian(law: Law) -> ca.Function:
    """(x, z) -> (d(x_next, u)/d(x, z), flags)."""
    x, z = ca.SX.sym("x", len(law.state)), ca.SX.sym("z", len(law.inputs))
    x_next, u, flags = sample(law)(x, z)
    return ca.Function("jacobian", [x, z], [ca.jacobian(ca.vertcat(x_next, u), ca.vertcat(x, z)), flags])


def _points(law: Law) -> Iterator[tuple[Array, Array]]:
    """States and inputs on the trajectories, after the first sample of each."""
    step = sample(law)
    reference, measurement = reference_and_measurement(law.inputs)
    wires = law.inputs[reference], law.inputs[measurement]
    low, high = max(wire.low for wire in wires), min(wire.high for wire in wires)
    if low > high:
        raise DesignError(
            f"the ranges of signals.{wires[0].name} and signals.{wires[1].name} do not meet; correct them"
        )
    rest = np.array(law.rest or [_rest(signal) for signal in law.inputs])
    shares = [0.0, *(sign * share for share in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1) for sign in (1, -1))]
    middles = (min(max(0.0, low), high), (low + high) / 2, low + 0.37 * (high - low))  # the last is no round number
    for middle, share in itertools.product(middles, shares):
        z = rest.copy()
        z[measurement] = middle
        for state in law.states:
            z[state] = rest[state]
        z[reference] = min(max(middle + share * (high - low), wires[0].low), wires[0].high)
        x = np.array(law.start, dtype=np.float64)
        for _ in range(SAMPLES):
            x = np.array(step(x, z)[0]).ravel()
            yield x, z


def _smooth(law: Law, jacobian: ca.Function, x: Array, z: Array) -> Array | None:
    """Jacobian at the point, None where a flag is raised or a small move of any coordinate changes it."""
    here, flags = (np.array(part, dtype=np.float64) for part in jacobian(x, z))
    if np.any(flags != 0):
        return None
    n = len(law.state)
    for index, signal in enumerate(law.state + law.inputs):
        width = signal.high - signal.low
        move = NUDGE * (width if np.isfinite(width) else 1.0)
        for sign in (1, -1):
            moved = np.concatenate([x, z])
            moved[index] += sign * move
            there, flags = (np.array(part, dtype=np.float64) for part in jacobian(moved[:n], moved[n:]))
            if np.any(flags != 0) or not np.allclose(here, there, rtol=SAME, atol=SAME * float(np.abs(here).max())):
                return None
    return here


def _reached(a: Array, b: Array) -> list[int]:
    """State variables that some input moves, directly or through others."""
    reached: set[int] = {int(index) for index in np.flatnonzero(np.any(b != 0, axis=1))}
    while True:
        further = {int(index) for index in np.flatnonzero(np.any(a[:, sorted(reached)] != 0, axis=1))} | reached
        if further == reached:
            return sorted(reached)
        reached = further


def _rest(signal: Signal) -> float:
    return min(max(0.0, signal.low), signal.high)
