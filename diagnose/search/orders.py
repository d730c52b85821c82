"""Find how often per turn a torque repeats, and when a load came: through the linear plant, without a simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.fit import Fitted
from firmloop.diagnose.model.hypothesis import Problem
from firmloop.diagnose.model.slopes import whitened
from firmloop.diagnose.policy import HIGHEST_ORDER, KEPT_ORDERS, MOMENTS_TRIED, ORDERS_AT_ONCE, SLOW_SHARE
from firmloop.diagnose.search.screen import Ground, Order
from firmloop.identify.fitting.projection import outside
from firmloop.identify.plants.effects import effect_seen_by
from firmloop.identify.simulation.linear_response import effort_of, response
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.superset import travelled

Array = NDArray[np.float64]
Torque = Callable[[int, float], NDArray[np.floating]]  # (recording, choice) -> (n, b)


def best_orders(problem: Problem, base: Fitted, grounds: Sequence[Ground]) -> Mapping[str, tuple[Order, ...]]:
    """Return by the name of the effect what promises most under any of the grounds, best first.

    A wave once a turn is the pull of a weight.
    """
    found = {name: _best(problem, base, grounds, *each) for name, each in _torques(problem, base).items()}
    waves = found.get(effect_seen_by("order").name, ())
    return {**found, effect_seen_by("turn").name: tuple(each for each in waves if each.choice == 1.0)}


def linear_traces(problem: Problem, base: Fitted) -> Mapping[str, Callable[[], Iterator[tuple[Array, ...]]]]:
    """Return by the name of the effect what each choice does to the outputs (n, r, b) of every recording."""

    def traces(choices: Array, torque: Torque) -> Iterator[tuple[Array, ...]]:
        plants = [response(problem.plant, base.point.values, recording) for recording in problem.train]
        for choice in choices:
            yield tuple(
                plant.to(np.asarray(torque(k, float(choice)), dtype=np.float64), len(recording.time))
                for k, (plant, recording) in enumerate(zip(plants, problem.train, strict=True))
            )

    return {name: partial(traces, *each) for name, each in _torques(problem, base).items()}


def _torques(problem: Problem, base: Fitted) -> Mapping[str, tuple[Array, Torque]]:
    """Return by the name of the effect the choices and their torques."""
    plant, values = problem.plant, base.point.values
    if not np.all(np.isfinite(linearize(plant).a)):
        return {}
    found: dict[str, tuple[Array, Torque]] = {}
    if any(balance.kind in ("torque", "force") for balance in plant.balances):
        span = max(float(recording.time[-1]) for recording in problem.train)
        moments = span * np.arange(1, MOMENTS_TRIED) / MOMENTS_TRIED
        found[effect_seen_by("moment").name] = (
            moments,
            lambda k, at: (problem.train[k].time >= at)[:, None] * 1.0,
        )
    angles = angles_of(problem, base)
    if not any(balance.kind == "torque" for balance in plant.balances) or not angles:
        return found
    efforts = [effort_of(plant, values, recording) for recording in problem.train]
    slow = np.quantile(np.concatenate([np.abs(np.diff(angle, axis=0)) for angle in angles]), SLOW_SHARE)
    orders = np.arange(1.0, HIGHEST_ORDER + 1.0)
    waves = orders[: max(int(np.sum(orders * slow < np.pi)), 1)]  # the others pass between two rows
    found[effect_seen_by("order").name] = waves, lambda k, order: _wave(order * angles[k])
    found[effect_seen_by("order of effort").name] = (
        waves,
        lambda k, order: efforts[k][:, None] * _wave(order * angles[k]),
    )
    return found


def angles_of(problem: Problem, base: Fitted) -> list[Array]:
    """Return the angle (n,) in rad that waves follow in every recording; empty where there is none."""
    if problem.engine.recorded:
        angles = [problem.engine.angle(recording) for recording in problem.train]
    else:
        names = [signal.name for signal in problem.plant.outputs]
        angles = []
        for recording, residual in zip(problem.train, base.residuals, strict=True):
            simulated = {name: recording.columns[name] - residual[:, k] for k, name in enumerate(names)}
            angles.append(travelled(replace(recording, columns={**recording.columns, **simulated})))
    found = [angle for angle in angles if angle is not None]
    return found if len(found) == len(angles) else []


def _wave(angle: Array) -> Array:
    return np.stack([np.sin(angle), np.cos(angle)], axis=1).astype(np.float64)


def _explained(pure: Array, left: Array) -> tuple[Array, Array]:
    """Return how much of the power of `left` (rows,) combinations of columns (rows, c, b) have: (c,); their sizes."""
    lengths = np.linalg.norm(pure, axis=0)
    scaled = (pure / lengths).transpose(1, 2, 0)
    shares = scaled @ left
    inverse = np.linalg.pinv(scaled @ scaled.transpose(0, 2, 1), rcond=1e-13, hermitian=True)
    taken = np.einsum("cbd,cd->cb", inverse, shares)
    return np.sum(shares * taken, axis=1), np.linalg.norm(taken / lengths, axis=1)


def _best(
    problem: Problem,
    base: Fitted,
    grounds: Sequence[Ground],
    choices: Array,
    torque: Torque,
) -> tuple[Order, ...]:
    """Return the best choices: `torque(k, choice)` (n, b) acts in recording k."""
    gains, sizes = np.zeros((2, len(grounds), len(choices)))
    plants = [response(problem.plant, base.point.values, recording) for recording in problem.train]
    for first in range(0, len(choices), ORDERS_AT_ONCE):
        some = choices[first : first + ORDERS_AT_ONCE]
        moved = [
            plant.to(np.concatenate([torque(k, float(choice)) for choice in some], axis=1), len(recording.time))
            for k, (plant, recording) in enumerate(zip(plants, problem.train, strict=True))
        ]
        for index, under in enumerate(grounds):
            tall = np.concatenate([whitened(each, under.noises) for each in moved])
            pure = outside(under.basis, tall)
            live = np.linalg.norm(pure, axis=0) > 1e-6 * np.linalg.norm(tall, axis=0)
            seen = np.flatnonzero(np.all(live.reshape(len(some), -1), axis=1))
            told = _explained(pure.reshape(len(pure), len(some), -1)[:, seen], under.left)
            gains[index, first + seen], sizes[index, first + seen] = told
    ranked = np.argsort(-gains, axis=1)[:, :KEPT_ORDERS].T
    best: dict[float, Order] = {}
    for row in ranked:
        for index, place in enumerate(row):
            choice = float(choices[place])
            best.setdefault(choice, Order(choice, float(sizes[index, place])))
    return tuple(best.values())
