"""Fit a hypothesis to recordings: whitened simulation-error least squares with every initial state free."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnose.hypothesis import Cause, Coordinate, Point, Scene, coordinates, full_start, outputs_of
from identify.noise import Noise, fit_noise
from identify.recording import Recording

Array = NDArray[np.float64]

FAR = 1e4  # times the noise: what a diverged simulation counts
_ENOUGH = 5e-5  # relative decrease of the cost that is no longer worth a step
_WORTH = 0.02  # decrease of the cost, in units of the noise, that is no longer worth a step
_GIVEN = (
    0.3  # standard deviation of a given nominal parameter, as a logarithm: it only counts where the data are silent
)
_PATIENCE = 2.5  # s of computing for one fit: stiff corners of some effects simulate very slowly
_TELLING = 0.01  # of a variance: test recordings that would take away less of it say nothing
_LAST_STEPS, _LAST_GAIN = 4, 1e-3  # steps at the very end of a fit, and what the last of them gains
_STEP = 1e-5  # of a coordinate, for difference quotients
_SAME = 0.02  # of log(kt / ke): in SI units a motor's torque constant is its voltage constant
_KEPT = 16  # slopes for initial states
_NEAR = 0.3  # of log(kt / ke) as given, up to which the two are meant to be the same constant


@dataclass(frozen=True, slots=True)
class Fitted:
    """A hypothesis at its best point; residuals are measured - simulated (n, r) per recording, in the outputs' units.

    `normal` is J'J of the whitened slopes for (coordinates, initial states of each recording in turn). `wider` (k,) are
    the factors by which deviations are larger than it says; None for 1.
    """

    causes: tuple[Cause, ...]
    coordinates: tuple[Coordinate, ...]
    point: Point
    residuals: tuple[Array, ...]
    cost: float  # sum of squares of the whitened residuals
    normal: Array
    wider: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Effects by name, in the order they were found."""
        return tuple(cause.effect.name for cause in self.causes)


def residual_of(scene: Scene, recording: Recording, point: Point, index: int) -> Array:
    """Return measured - simulated (n, r) of one recording; a diverged simulation counts as far off."""
    simulated = scene.engine.simulate(recording, dict(point.values), point.starts[index])
    left = outputs_of(scene, recording) - simulated
    return left if np.all(np.isfinite(left)) else np.full_like(left, np.nan)


def whitened(values: Array, noises: Sequence[Noise]) -> Array:
    """Whiten (n, r, ...) output by output and stack to (n r, ...)."""
    parts = [noise.whiten(values[:, index]) for index, noise in enumerate(noises)]
    return np.concatenate(parts, axis=0)


def noises_of(scene: Scene, residuals: Sequence[Array]) -> tuple[Noise, ...]:
    """Estimate every output's noise from what a fit left over."""
    return tuple(
        fit_noise([part[:, index] for part in residuals], float(scene.floors[index]))
        for index in range(residuals[0].shape[1])
    )


def slopes_of(
    scene: Scene,
    recording: Recording,
    unknowns: Sequence[Coordinate],
    point: Point,
    index: int,
    residual: Array,
    own: Array | None = None,
) -> Array:
    """Return d output / d (coordinates, initial state) (n, r, k + s) at a point that leaves `residual` (n, r).

    `own` are those for the initial state, where they are known (see start_slopes).
    """
    own = start_slopes(scene, recording, point, index) if own is None else own
    slopes = np.zeros((*residual.shape, len(unknowns)))
    for place, each in enumerate(unknowns):
        value = point.values.get(each.name, scene.engine.neutral[each.name])
        inside = each.inner(value) + (_STEP if each.logarithmic else _STEP * max(abs(value) / each.scale, 0.01))
        moved = each.outer(inside)
        if not moved > value:  # at its upper bound
            moved = each.outer(2.0 * each.inner(value) - inside)
        change = each.inner(moved) - each.inner(value)
        if change != 0.0:
            near = Point({**point.values, each.name: moved}, point.starts)
            slopes[..., place] = (residual - residual_of(scene, recording, near, index)) / change
    whole: Array = np.concatenate([slopes, own], axis=2)
    return np.asarray(np.nan_to_num(whole, nan=0.0, posinf=0.0, neginf=0.0))


def start_slopes(scene: Scene, recording: Recording, point: Point, index: int) -> Array:
    """Return d output / d initial state (n, r, s).

    Those of a linear plant are taken without effects, once: what an initial state does dies out soon, and a search that
    accepts only what lowers the cost can do with that. In any other plant they depend on where it goes, and a phase of
    the mains never dies out.
    """
    linear = scene.engine.engine.equations is None
    values, start = ({}, full_start(scene, recording)) if linear else (point.values, point.starts[index])
    key = (id(recording), tuple(sorted(values.items())), start.tobytes())
    found = scene.memory.get(key)
    if found is None:
        while len(scene.memory) >= max(_KEPT, len(scene.train) + len(scene.test)):
            scene.memory.pop(next(iter(scene.memory)))
        names = [f"start.{state}" for state in scene.engine.states]
        found = scene.memory[key] = scene.engine.slopes(recording, values, names, start)
    return found


def fit(
    scene: Scene,
    recordings: Sequence[Recording],
    causes: Sequence[Cause],
    begin: Point,
    noises: Sequence[Noise],
    steps: int,
) -> Fitted:
    """Search from `begin` by Levenberg and Marquardt; bounds hold by stopping at them."""
    unknowns = coordinates(scene, causes, begin.values)
    count, states = len(unknowns), len(scene.engine.states)
    tether = tethers(scene, unknowns)
    point, cost, residuals = _judged(scene, recordings, begin, noises)
    damping, normal = 1e-3, np.zeros((0, 0))
    begun = time.process_time()
    own = [start_slopes(scene, recording, point, k) for k, recording in enumerate(recordings)]  # good for a few steps
    for _ in range(steps):
        if time.process_time() - begun > _PATIENCE:
            break
        packed = _packed(scene, recordings, unknowns, point, residuals, noises, own)
        normal, pulled = _tied(packed, tether, _inner(scene, unknowns, point))
        moved = False
        for _ in range(6):
            step = _solve(normal, pulled, damping)
            step[:count] = np.clip(step[:count], -3.0, 3.0)
            trial = _moved(scene, unknowns, point, step, states)
            next_point, next_cost, next_residuals = _judged(scene, recordings, trial, noises)
            if next_cost + _pull(scene, unknowns, trial, tether) < cost + _pull(scene, unknowns, point, tether):
                moved = True
                break
            damping = max(damping * 8.0, 1e-6)
        if not moved:
            break
        gain = cost - next_cost + _pull(scene, unknowns, point, tether) - _pull(scene, unknowns, trial, tether)
        point, cost, residuals = next_point, next_cost, next_residuals
        damping = max(damping / 6.0, 1e-9)
        if gain < max(_WORTH, _ENOUGH * cost):
            break
    if normal.size == 0:
        packed = _packed(scene, recordings, unknowns, point, residuals, noises, own)
        normal, _ = _tied(packed, tether, _inner(scene, unknowns, point))
    return Fitted(tuple(causes), unknowns, point, residuals, cost, normal)


def ended(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Take a fit to its minimum by undamped steps, however little each is worth, and put `normal` there.

    A search ends where a step gains less than the noise, which for parameters that trade with each other may be a
    deviation away. Where contacts and kinks make slopes jump, one place may promise far more than others near it:
    deviations are the largest that any of them tells.
    """
    unknowns, causes = fitted.coordinates, fitted.causes
    count, states = len(unknowns), len(scene.engine.states)
    tether = tethers(scene, unknowns)
    point, cost, residuals = _judged(scene, scene.train, fitted.point, noises)
    normal = fitted.normal
    told = [variances(normal, count)]
    for _ in range(_LAST_STEPS):
        packed = _packed(scene, scene.train, unknowns, point, residuals, noises)
        normal, pulled = _tied(packed, tether, _inner(scene, unknowns, point))
        told.append(variances(normal, count))
        step = _solve(normal, pulled, 0.0)
        step[:count] = np.clip(step[:count], -1.0, 1.0)
        here = cost + _pull(scene, unknowns, point, tether)
        for share in (1.0, 0.3, 0.1):
            trial = _moved(scene, unknowns, point, share * step, states)
            _, next_cost, next_residuals = _judged(scene, scene.train, trial, noises)
            gain = here - next_cost - _pull(scene, unknowns, trial, tether)
            if gain > 0.0:
                point, cost, residuals = trial, next_cost, next_residuals
                break
        if gain < _LAST_GAIN:
            break
    seen = told[-1] > 0.0
    wider = np.sqrt(np.where(seen, np.max(told, axis=0), 1.0) / np.where(seen, told[-1], 1.0))
    return Fitted(causes, unknowns, point, tuple(residuals), cost, normal, wider)


def cost_at(scene: Scene, fitted: Fitted, point: Point, noises: Sequence[Noise]) -> float:
    """Return the cost of a fit's hypothesis at another point, tied to what is known beforehand."""
    _, cost, _ = _judged(scene, scene.train, point, noises)
    return cost + _pull(scene, fitted.coordinates, point, tethers(scene, fitted.coordinates))


def moved(scene: Scene, fitted: Fitted, step: Array) -> Point:
    """Return the point a step (k + s w,) of all unknowns away from a fit."""
    return _moved(scene, fitted.coordinates, fitted.point, step, len(scene.engine.states))


def _tied(packed: Array, tether: Array, at: Array) -> tuple[Array, Array]:
    """Return J'J (k + s w, same) and the descent of what `_packed` tells, tied to what is known beforehand."""
    count, weights = len(at), tether[:, :-1]
    normal, pulled = packed[:-1, :-1], -packed[:-1, -1]
    normal[:count, :count] += weights.T @ weights
    pulled[:count] -= weights.T @ (weights @ at - tether[:, -1])
    return normal, pulled


def variances(normal: Array, count: int) -> Array:
    """Return the variances (k,) of the first `count` coordinates."""
    return np.asarray(np.diag(inverse(normal))[:count])


def with_doubt(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Widen the deviations of what the test recordings would have elsewhere, as two averages that disagree.

    With the test recordings x would move by (A + B)^-1 b, whose covariance is A^-1 - (A + B)^-1 if both sets are alike:
    A and B are the information of train and test on the coordinates, b is the score of test. A move of d deviations
    widens by d / sqrt(2), as the scale factor of the Particle Data Group does for the mean of two.
    """
    count = len(fitted.coordinates)
    if not scene.test or not count:
        return fitted
    starts = tuple(full_start(scene, recording) for recording in scene.test)
    point = fit_starts(scene, scene.test, Point(fitted.point.values, starts), noises)
    _, _, residuals = _judged(scene, scene.test, point, noises)
    packed = _packed(scene, scene.test, fitted.coordinates, point, residuals, noises)
    own_places = range(count)
    first, second = _reduced(fitted.normal, own_places), _reduced(packed[:-1, :-1], own_places)
    across, pulled = packed[:count, count:-1], packed[:-1, -1]
    score = across @ inverse(packed[count:-1, count:-1]) @ pulled[count:] - pulled[:count]
    own, joint = inverse(first), inverse(first + second)
    moved = joint @ score
    allowed = np.diag(own) - np.diag(joint)
    telling = allowed > _TELLING * np.diag(own)
    apart = np.where(telling, np.abs(moved) / np.sqrt(np.where(telling, allowed, 1.0)), 0.0)
    known = np.ones(count) if fitted.wider is None else fitted.wider
    return replace(fitted, wider=known * np.maximum(apart / np.sqrt(2.0), 1.0))


def _reduced(normal: Array, kept: Sequence[int]) -> Array:
    """Return the information on the coordinates `kept` once all others have been fitted."""
    rest = [k for k in range(len(normal)) if k not in kept]
    across = normal[np.ix_(kept, rest)]
    return np.asarray(normal[np.ix_(kept, kept)] - across @ inverse(normal[np.ix_(rest, rest)]) @ across.T)


def inverse(normal: Array, least: float = 1e-12) -> Array:
    """Return the pseudo-inverse of a symmetric matrix, whatever the sizes of its coordinates.

    Combinations whose singular value is below `least` of the largest are taken to have none.
    """
    sizes = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.asarray(np.linalg.pinv(normal / np.outer(sizes, sizes), rcond=least) / np.outer(sizes, sizes))


def tethers(scene: Scene, unknowns: Sequence[Coordinate]) -> Array:
    """Return rows [weights over the coordinates, aim] of what is known beforehand, in standard deviations."""
    given = {p.name: p.value for p in scene.plant.parameters}
    places = {each.name: index for index, each in enumerate(unknowns)}
    rows = []
    for each in unknowns:
        if each.name in given and np.isfinite(given[each.name]):
            row = np.zeros(len(unknowns) + 1)
            row[places[each.name]] = 1.0 / (_GIVEN if each.logarithmic else 10.0)
            row[-1] = row[places[each.name]] * each.inner(given[each.name])
            rows.append(row)
    ke, kt = given.get("ke_V_s_rad", 0.0), given.get("kt_N_m_A", 0.0)
    if ke > 0.0 and kt > 0.0 and abs(np.log(kt / ke)) < _NEAR:
        row = np.zeros(len(unknowns) + 1)
        for name, sign, fixed in (("kt_N_m_A", 1.0, kt), ("ke_V_s_rad", -1.0, ke)):
            if name in places:
                row[places[name]] = sign / _SAME
            else:
                row[-1] -= sign * np.log(fixed) / _SAME
        rows.append(row)
    return np.array(rows).reshape(len(rows), len(unknowns) + 1)


def _pull(scene: Scene, unknowns: Sequence[Coordinate], point: Point, tether: Array) -> float:
    return float(np.sum((tether[:, :-1] @ _inner(scene, unknowns, point) - tether[:, -1]) ** 2))


def _judged(
    scene: Scene, recordings: Sequence[Recording], point: Point, noises: Sequence[Noise]
) -> tuple[Point, float, tuple[Array, ...]]:
    residuals = tuple(residual_of(scene, recording, point, k) for k, recording in enumerate(recordings))
    cost = 0.0
    for part in residuals:
        if np.any(np.isnan(part)):
            cost += FAR**2 * part.size
        else:
            cost += float(np.sum(whitened(part, noises) ** 2))
    return point, cost, residuals


def _packed(
    scene: Scene,
    recordings: Sequence[Recording],
    unknowns: Sequence[Coordinate],
    point: Point,
    residuals: Sequence[Array],
    noises: Sequence[Noise],
    own: Sequence[Array] | None = None,
) -> Array:
    """Return [J r]'[J r] of the whitened problem, shape (k + s w + 1, same); r is simulated - measured."""
    count, states, lot = len(unknowns), len(scene.engine.states), len(recordings)
    total = np.zeros((count + states * lot + 1, count + states * lot + 1))
    for k, recording in enumerate(recordings):
        if np.any(np.isnan(residuals[k])):
            continue
        slopes = slopes_of(scene, recording, unknowns, point, k, residuals[k], None if own is None else own[k])
        tall = np.concatenate([slopes, -residuals[k][..., None]], axis=2)
        flat = whitened(tall, noises)
        places = np.concatenate([np.arange(count), count + states * k + np.arange(states), [count + states * lot]])
        total[np.ix_(places, places)] += flat.T @ flat
    return total


def _solve(normal: Array, pulled: Array, damping: float) -> Array:
    sizes = np.sqrt(np.maximum(np.diag(normal), 0.0))
    live = sizes > 1e-9
    step = np.zeros(len(pulled))
    scaled = normal[np.ix_(live, live)] / np.outer(sizes[live], sizes[live])
    scaled = scaled + (damping + 1e-12) * np.eye(int(live.sum()))
    step[live] = np.linalg.lstsq(scaled, pulled[live] / sizes[live], rcond=1e-13)[0] / sizes[live]
    return step


def _inner(scene: Scene, unknowns: Sequence[Coordinate], point: Point) -> Array:
    return np.array([each.inner(point.values.get(each.name, scene.engine.neutral[each.name])) for each in unknowns])


def _moved(scene: Scene, unknowns: Sequence[Coordinate], point: Point, step: Array, states: int) -> Point:
    inner = _inner(scene, unknowns, point) + step[: len(unknowns)]
    values = dict(point.values)
    for each, place in zip(unknowns, inner, strict=True):
        values[each.name] = each.outer(float(place))
    starts = tuple(
        start + step[len(unknowns) + states * k : len(unknowns) + states * (k + 1)]
        for k, start in enumerate(point.starts)
    )
    return Point(values, starts)


def fit_starts(scene: Scene, recordings: Sequence[Recording], point: Point, noises: Sequence[Noise]) -> Point:
    """Fit the initial states alone, by two Gauss-Newton steps."""
    starts = []
    for k, recording in enumerate(recordings):
        here = Point(point.values, tuple(point.starts[k] for _ in recordings))
        _, cost, residuals = _judged(scene, [recording], Point(here.values, (here.starts[0],)), noises)
        best = here.starts[0]
        for _ in range(2):
            single = Point(point.values, (best,))
            packed = _packed(scene, [recording], (), single, residuals, noises)
            step = _solve(packed[:-1, :-1], -packed[:-1, -1], 1e-9)
            _, next_cost, next_residuals = _judged(scene, [recording], Point(point.values, (best + step,)), noises)
            if not next_cost < cost:
                break
            best, cost, residuals = best + step, next_cost, next_residuals
        starts.append(best)
    return Point(point.values, tuple(starts))


def evidence(fitted: Fitted, noises: Sequence[Noise]) -> float:
    """Return -2 log likelihood + BIC penalty; innovations have the variance that each output's noise model says.

    Infinite for a simulation that has diverged.
    """
    rows = sum(len(part) for part in fitted.residuals)
    own = sum(noise.unlikely(rows) for noise in noises)
    unknowns = len(fitted.coordinates)
    total = float(own + unknowns * np.log(rows * len(noises)))
    return total if np.isfinite(total) else np.inf
