"""Test what is left for a shape: a torque or voltage that follows some coordinate, whatever its name may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from diagnose.locate import Latent, latent, nominal_plant
from diagnose.rank import Search
from diagnose.refit import slopes_of, whitened
from diagnose.response import disturbed
from diagnose.rival import Rival
from diagnose.screen import orthogonal
from identify.linear import linearize
from identify.plant import Plant
from identify.recording import Recording
from identify.simulate import course_of
from identify.superset import travelled

Array = NDArray[np.float64]

_HATS = 10
_HARMONICS = 4


@dataclass(frozen=True, slots=True)
class Shape:
    """A term of one balance that follows one coordinate.

    `gain` is the drop of the whitened sum of squares by `unknowns` hats or waves; `points` (b, 2) are the coordinate
    and the term there, in SI units.
    """

    balance: str
    coordinate: str
    unknowns: int
    gain: float
    points: Array


def best_shape(search: Search, rival: Rival) -> Shape | None:
    """Return the shape that explains most of what an explanation leaves over."""
    plant = nominal_plant(search, rival)
    seen = [latent(plant, recording, [noise.rms for noise in rival.noises]) for recording in search.scene.train]
    if any(each is None for each in seen):
        return None
    found: list[Shape] = []
    basis, left = _complement(search, rival)
    kinds = seen[0].kinds if seen[0] is not None else ()
    for number, kind in enumerate(kinds):
        regressors = [
            _regressors(plant, recording, each)
            for recording, each in zip(search.scene.train, seen, strict=True)
            if each
        ]
        for name in regressors[0]:
            stacked = np.concatenate([table[name][1] for table in regressors])
            columns = []
            for recording, table in zip(search.scene.train, regressors, strict=True):
                term = _hats(table[name][1], stacked, table[name][0])
                columns.append(whitened(disturbed(plant, {}, recording, term, number), rival.noises))
            tall = np.concatenate(columns)
            pure = tall - basis @ (basis.T @ tall)
            live = np.linalg.norm(pure, axis=0) > 1e-4 * np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
            if not np.any(live):
                continue
            axis = orthogonal(pure[:, live])
            gain = float(np.sum((axis.T @ left) ** 2))
            answer = np.zeros(tall.shape[1])
            answer[live] = np.linalg.lstsq(pure[:, live], left, rcond=1e-6)[0]
            centres = _centres(stacked, table[name][0])
            points = np.column_stack([centres, _hats(centres, stacked, table[name][0]) @ answer])
            found.append(Shape(kind, name, int(live.sum()), gain, points))
    return max(found, key=lambda each: each.gain - 10.0 * each.unknowns, default=None)


def _complement(search: Search, rival: Rival) -> tuple[Array, Array]:
    """Return the whitened slopes' basis, and the whitened residuals outside of it."""
    parts, lefts = [], []
    count, states = len(rival.fitted.coordinates), len(search.scene.engine.states)
    lot = len(search.scene.train)
    for k, recording in enumerate(search.scene.train):
        at = rival.fitted
        slopes = slopes_of(search.scene, recording, at.coordinates, at.point, k, at.residuals[k])
        wide = np.zeros((*slopes.shape[:2], count + states * lot))
        wide[..., :count] = slopes[..., :count]
        wide[..., count + states * k : count + states * (k + 1)] = slopes[..., count:]
        parts.append(whitened(wide, rival.noises))
        lefts.append(whitened(rival.fitted.residuals[k], rival.noises))
    basis = orthogonal(np.concatenate(parts))
    left = np.concatenate(lefts)
    return basis, left - basis @ (basis.T @ left)


def _regressors(plant: Plant, recording: Recording, seen: Latent) -> Mapping[str, tuple[bool, Array]]:
    """Return coordinates a term could follow: (periodic, values (n,)) by name.

    Speeds and currents are simulated, not measured: the noise of a measured one would correlate with what is left.
    A simulated position drifts, so that is smoothed.
    """
    rows = len(seen.time)
    moved = _simulated_states(plant, recording)[:rows]
    table: dict[str, tuple[bool, Array]] = {}
    for index, signal in enumerate(plant.states):
        place = signal.name.startswith("position_")
        values = seen.states[:, index] if place else moved[:, index]
        turning = signal.name == "position_rad"
        table[f"{signal.name} (per turn)" if turning else signal.name] = (turning, values)
    angle = travelled(recording)
    if "position_rad" not in {signal.name for signal in plant.states} and angle is not None:
        table["angle (per turn)"] = (True, angle[:rows])
    table[plant.inputs[0].name] = (False, course_of(plant, recording).drive[:rows, 0])
    return table


def _simulated_states(plant: Plant, recording: Recording) -> Array:
    """Return the states (n, s) of the linear plant from rest."""
    course, bare = course_of(plant, recording), linearize(plant)
    states, inputs = bare.b.shape
    whole = np.zeros((states + inputs, states + inputs))
    whole[:states, :states], whole[:states, states:] = bare.a, bare.b
    moved = expm(whole * course.step)
    step, pushed = moved[:states, :states], course.drive @ moved[:states, states:].T
    found = np.zeros((len(pushed), states))
    for row in range(len(pushed) - 1):
        found[row + 1] = step @ found[row] + pushed[row]
    return found


def _centres(values: Array, periodic: bool) -> Array:
    if periodic:
        return np.linspace(0.0, 2.0 * np.pi, 25)
    return np.unique(np.quantile(values, np.linspace(0.0, 1.0, _HATS)))


def _hats(at: Array, values: Array, periodic: bool) -> Array:
    """Return piecewise linear hats over the quantiles of `values`, or waves, at `at` (n,): (n, b)."""
    if periodic:
        waves = [wave(order * at) for order in range(1, _HARMONICS + 1) for wave in (np.sin, np.cos)]
        return np.stack(waves, axis=1)
    knots = _centres(values, False)
    return np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=1)
