"""Simulate what a point leaves of a recording, and how that changes with parameters and initial states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.hypothesis import Point, Problem, Unknown, full_start, outputs_of
from firmloop.diagnose.policy import ACROSS_KINKS, KEPT_SLOPES, ROUGH_DIFFERENCE_STEP
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


def residual_of(problem: Problem, recording: Recording, point: Point, index: int, most: float = math.inf) -> Array:
    """Return measured - simulated (n, r) of one recording; a diverged simulation counts as far off.

    So does one of more than `most` million steps. Rows that are read when the input is no longer recorded count as
    those before them, in reverse.
    """
    simulated = problem.engine.simulate(recording, dict(point.values), point.starts[index], most)
    left = outputs_of(problem, recording) - simulated
    unfed = min(problem.engine.unfed(recording, point.values), len(left) // 2)
    if unfed:
        left[-unfed:] = left[-2 * unfed : -unfed][::-1]
    return _shown(problem, recording, left) if np.all(np.isfinite(left)) else np.full_like(left, np.nan)


def _shown(problem: Problem, recording: Recording, rows: Array) -> Array:
    """Return rows (n, r, ...) as they count: those that are hidden not at all; they are changed in place."""
    first, end = problem.hidden.get(id(recording), (0, 0))
    rows[first:end] = 0.0
    if problem.weights:
        rows *= problem.weights[id(recording)].reshape(1, -1, *[1] * (rows.ndim - 2))
    return rows


def whitened(values: Array, noises: Sequence[Noise]) -> Array:
    """Whiten (n, r, ...) output by output and stack to (n r, ...), below it what is larger than noise may be."""
    parts = [noise.whiten(values[:, index]) for index, noise in enumerate(noises)]
    parts += [noise.weight * values[:, index] for index, noise in enumerate(noises) if noise.weight > 0.0]
    return np.concatenate(parts, axis=0)


def slopes_of(
    problem: Problem,
    recording: Recording,
    unknowns: Sequence[Unknown],
    point: Point,
    index: int,
    residual: Array,
    own: Array | None = None,
) -> Array:
    """Return d output / d (coordinates, initial state) (n, r, k + s) at a point that leaves `residual` (n, r).

    `own` are those for the initial state, where they are known (see start_slopes).
    """
    own = start_slopes(problem, recording, point, index) if own is None else own
    slopes = np.zeros((*residual.shape, len(unknowns)))
    for place, each in enumerate(unknowns):
        value = _value(problem, point, each)
        inside = each.inner(value) + each.step * _share(each, value)
        moved = each.outer(inside)
        if not moved > value:  # at its upper bound
            moved = each.outer(2.0 * each.inner(value) - inside)
        change = each.inner(moved) - each.inner(value)
        if change != 0.0:
            slopes[..., place] = (residual - _moved(problem, recording, point, index, each, moved)) / change
    return _finite(slopes, own)


def slopes_across(
    problem: Problem, recording: Recording, unknowns: Sequence[Unknown], point: Point, index: int, own: Array
) -> Array:
    """Return the same by central quotients that take in either side of a kink: the mean of the slopes there."""
    slopes = np.zeros((*outputs_of(problem, recording).shape, len(unknowns)))
    for place, each in enumerate(unknowns):
        value = _value(problem, point, each)
        wide = min(ACROSS_KINKS * each.step, ROUGH_DIFFERENCE_STEP) * _share(each, value)
        ends = [each.outer(each.inner(value) + side * wide) for side in (1.0, -1.0)]
        change = each.inner(ends[0]) - each.inner(ends[1])
        if change != 0.0:
            above, below = (_moved(problem, recording, point, index, each, end) for end in ends)
            slopes[..., place] = (below - above) / change
    return _finite(slopes, own)


def _value(problem: Problem, point: Point, each: Unknown) -> float:
    """Return the value of an unknown at a point."""
    return point.values.get(each.name, problem.engine.neutral[each.name])


def _share(each: Unknown, value: float) -> float:
    """Return what a step of an unknown at a value is a share of, in its coordinate."""
    return 1.0 if each.logarithmic else max(abs(value) / each.scale, 0.01)


def _moved(problem: Problem, recording: Recording, point: Point, index: int, each: Unknown, value: float) -> Array:
    """Return what is left (n, r) where one unknown has another value."""
    return residual_of(problem, recording, Point({**point.values, each.name: value}, point.starts), index)


def _finite(slopes: Array, own: Array) -> Array:
    """Return slopes for coordinates, and those for an initial state beside them, with nothing that has diverged."""
    return np.asarray(np.nan_to_num(np.concatenate([slopes, own], axis=2), nan=0.0, posinf=0.0, neginf=0.0))


def start_slopes(problem: Problem, recording: Recording, point: Point, index: int, exact: bool = False) -> Array:
    """Return d output / d initial state (n, r, s).

    Those of a linear plant are taken without effects, once: what an initial state does dies out soon, and a search that
    accepts only what lowers the cost can do with that, but for its end, where `exact` ones are. In any other plant they
    depend on where it goes, and a phase of the mains never dies out.
    """
    if exact:
        return _anchored(problem, recording, point.values, point.starts[index])
    linear = problem.engine.engine.equations is None
    values, start = ({}, full_start(problem, recording)) if linear else (point.values, point.starts[index])
    key = (id(recording), tuple(sorted(values.items())), start.tobytes())
    found = problem.memory.get(key)
    if found is None:
        while len(problem.memory) >= max(KEPT_SLOPES, len(problem.train) + len(problem.test)):
            problem.memory.pop(next(iter(problem.memory)))
        problem.memory[key] = found = _anchored(problem, recording, values, start)
    own = [one.state for one in problem.plant.varying]
    if own and linear:  # these do not die out
        found = found.copy()
        chosen = [f"start.{problem.engine.states[state]}" for state in own]
        found[..., own] = problem.engine.slopes(recording, point.values, chosen, point.starts[index])
    return found


def _anchored(problem: Problem, recording: Recording, values: Mapping[str, float], start: Array) -> Array:
    """Return exact slopes (n, r, s) that hold what a recording that begins at rest tells of its initial state.

    They hold the place where the first train recording begins, too, if nobody measures it: all others count from there.
    Not in equations of one's own, which may depend on it.
    """
    held = set(problem.engine.known_states(recording))
    if recording is problem.train[0] and problem.plant.kind != "ode":
        held |= {
            k
            for k, name in enumerate(problem.engine.states)
            if name.startswith("position") and name not in recording.columns
        }
    free = [k for k in range(len(problem.engine.states)) if k not in held]
    names = [f"start.{problem.engine.states[k]}" for k in free]
    moved = problem.engine.slopes(recording, values, names, start)
    slopes = np.zeros((*moved.shape[:2], len(start)))
    slopes[..., free] = moved
    return _shown(problem, recording, slopes)
