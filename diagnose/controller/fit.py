"""Hold the replay of a controller against the recorded command, and fit the figures that bring them together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.controller.faults import Guess, played
from firmloop.diagnose.controller.record import LoopRecord
from firmloop.diagnose.model.fit import inverse
from firmloop.diagnose.policy import (
    DETERMINED_FIGURE,
    FARTHEST_FIGURE,
    FEWEST_COUNTED_ROWS,
    FIGURE_NUDGE,
    FINEST_FIGURE,
    LEAST_DIFFERENCE,
    LEAST_MISFIT_DECREASE,
    REPLAY_TRIALS,
    REPLAY_TURNS,
    ROUNDING_LANES,
)
from firmloop.verify.replay import Controller

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Match:
    """A guess at its best: `misfit` is the rms of (recorded - replayed) over what rounding alone would leave.

    `deviations` are one standard deviation each of the `figures` that were fitted.
    """

    guess: Guess
    figures: tuple[float, ...]
    deviations: tuple[float, ...]
    start: Array
    left: Array  # (n,) recorded - replayed, NaN where the replay says nothing
    misfit: float
    sample_s: float  # s, from one step to the next as recorded


def spread_of(
    controller: Controller, loop: LoopRecord, guess: Guess, start: Array, written: Array, rounding: float
) -> Array:
    """Return how far (n,) a right replay may stand off, rms: the roundings `written` (n, m + 1) of the recording.

    The inputs are moved within their roundings, so that what an integral gathers of them counts too; the program's own
    `rounding` comes on top.
    """
    random = np.random.default_rng(1)
    exact = played(controller, loop, guess, start)
    assert exact is not None
    power = np.zeros(len(loop.time))
    for _ in range(ROUNDING_LANES):
        moved = loop.inputs + written[:, :-1] * random.uniform(-0.5, 0.5, loop.inputs.shape)
        other = played(controller, replace(loop, inputs=moved), guess, start)
        assert other is not None
        power += np.nan_to_num(other - exact) ** 2 / ROUNDING_LANES
    least = LEAST_DIFFERENCE * max(abs(controller.output.low), abs(controller.output.high))
    return np.sqrt(power + written[:, -1] ** 2 / 12.0 + rounding**2 + least**2)


def match(
    controller: Controller,
    loop: LoopRecord,
    spread: Array,
    apply: Callable[[Sequence[float]], Guess],
    figures: Sequence[float],
    start: Array,
    states: Sequence[int],
    turns: int = REPLAY_TURNS,
) -> Match | None:
    """Fit the figures and these of the unknown first states; None where the guess cannot be played.

    Levenberg (1944) and Marquardt (1963) over difference quotients.
    """
    count = len(figures)
    base, sizes = np.array(figures), np.array([abs(figure) or 1.0 for figure in figures])
    reach = np.array([min(controller.law.state[k].high - controller.law.state[k].low, 1e6) for k in states])

    def first(place: Array) -> Array:
        begin = start.copy()
        begin[list(states)] += place[count:] * reach
        return begin

    def left_at(place: Array) -> Array | None:
        answer = played(controller, loop, apply(list(base + sizes * place[:count])), first(place))
        return None if answer is None else loop.command - answer

    place = np.zeros(count + len(states))
    left = left_at(place)
    if left is None:
        return None
    guess = apply(list(figures))
    held = np.isfinite(left)
    held[: guess.stride] = False  # what came before the first row is not known
    if held.sum() < FEWEST_COUNTED_ROWS:
        return None
    cost, damping = _power(left, spread, held), 1e-6
    slopes = np.zeros((int(held.sum()), len(place)))
    for _ in range(turns if len(place) else 0):
        for k in range(len(place)):
            moved = place.copy()
            moved[k] += FIGURE_NUDGE
            other = left_at(moved)
            slopes[:, k] = 0.0 if other is None else np.nan_to_num(((other - left) / spread / FIGURE_NUDGE)[held])
        normal, aim = slopes.T @ slopes, slopes.T @ (left / spread)[held]
        diagonal = np.diag(np.maximum(np.diag(normal), 1e-12 * max(float(np.diag(normal).max()), 1e-300)))
        before = cost
        for _ in range(REPLAY_TRIALS):
            step = -np.linalg.solve(normal + damping * diagonal, aim)
            trial = place + np.clip(step, -FARTHEST_FIGURE, FARTHEST_FIGURE)
            candidate = left_at(trial)
            lower = np.inf if candidate is None else _power(candidate, spread, held)
            if candidate is not None and lower < cost:
                place, left, cost = trial, candidate, lower
                damping = max(damping * 0.1, 1e-9)
                break
            damping *= 30.0
        if cost >= (1.0 - LEAST_MISFIT_DECREASE) * before:
            break
    own = base + sizes * place[:count]
    rows = (left / spread)[held]
    variance = np.diag(inverse(slopes.T @ slopes, DETERMINED_FIGURE))[:count] * max(1.0, cost) * _memory(rows)
    deviations = np.maximum(sizes * np.sqrt(np.maximum(variance, 0.0)), FINEST_FIGURE * np.abs(own))
    return Match(
        apply(list(own)),
        tuple(float(x) for x in own),
        tuple(float(x) for x in deviations),
        first(place),
        np.where(held, left, np.nan),
        float(np.sqrt(cost)),
        guess.stride * loop.row_s,
    )


def felt(controller: Controller, loop: LoopRecord, guess: Guess, start: Array) -> tuple[int, ...]:
    """Return the states whose first value the command shows."""
    seen = []
    base = played(controller, loop, guess, start)
    for k, signal in enumerate(controller.law.state):
        if signal.name in (*controller.law.tunable, controller.law.opening):
            continue  # a figure, and a flag: nothing that could have any value
        moved = start.copy()
        moved[k] += FIGURE_NUDGE * min(signal.high - signal.low, 1e6)
        other = played(controller, loop, guess, moved)
        if base is not None and other is not None and np.nanmax(np.abs(other - base)[guess.stride :]) > 0.0:
            seen.append(k)
    return tuple(seen)


def _power(left: Array, spread: Array, held: NDArray[np.bool_]) -> float:
    power = float(np.mean((left[held] / spread[held]) ** 2))
    return power if np.isfinite(power) else 1e300


def _memory(rows: Array) -> float:
    """Return by how much fewer independent rows there are, from the correlation of neighbours."""
    centred = rows - rows.mean()
    power = float(centred @ centred)
    alike = float(centred[1:] @ centred[:-1]) / power if power > 0.0 else 0.0
    return (1.0 + min(alike, 0.98)) / (1.0 - min(alike, 0.98)) if alike > 0.0 else 1.0
