"""Tell a load that lasts from a slow disturbance: by how much its average differs from batch to batch.

The noise models of outputs are short: a disturbance of a moment's memory, integrated to a place, looks like a load to
them. Over batches far longer than its memory it averages out, and the means of batches tell how well (batch means;
Fishman, Management Science 24 (1978) 510-521).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.hypothesis import MOMENT, Cause, Scene, searched
from firmloop.diagnose.pushes import batches, pushed, sizes_of
from firmloop.diagnose.refit import Fitted, deviations, widened
from firmloop.diagnose.rival import elsewhere, without
from firmloop.identify.fitting.noise import Noise, colored

Array = NDArray[np.float64]

_CHANCE = 3.0  # deviations of an average, less than which a slow disturbance has by chance
_PULLED = 5.0  # the same of what pulls by where it is
FEW = 500.0  # drop of BIC that such an average may bring
_BATCHES = 12  # of each recording
_WITHIN = 0.3  # of what an effect does, that its loads by batches may leave


def deviation(scene: Scene, fitted: Fitted, noises: Sequence[Noise], cause: Cause) -> float:
    """Return the standard deviation of a load or an offset that slow disturbances leave it; 0 where none is told."""
    means = _means(scene, fitted, noises, cause)
    if means is None:
        return 0.0
    moments = [fitted.point.values[key] for key in cause.keys if key.endswith(MOMENT)]
    first = min(moments, default=-np.inf)
    late = np.concatenate([batches(recording, _BATCHES) >= first for recording in scene.train])
    parts = [part for part in (np.sum(late), np.sum(~late)) if part]
    return float(np.std(np.concatenate(means), ddof=1) * np.sqrt(sum(1.0 / part for part in parts)))


def times_chance(scene: Scene, fitted: Fitted, noises: Sequence[Noise], cause: Cause) -> float:
    """Return how many deviations by batches a load, an offset or a spring is; infinite where none is told.

    What stays the same is there on unseen recordings, too.
    """
    if cause.effect.slow and not cause.effect.lasting and cause.effect.place == "torque" and colored(noises):
        return _times_pull(scene, fitted, noises, cause)
    value, spread = fitted.point.values[cause.keys[0]], deviation(scene, fitted, noises, cause)
    if spread > 0.0 and scene.test and not searched(cause):
        means = _means(*elsewhere(scene, fitted, noises), noises, cause)
        if means is not None:
            count, more = _BATCHES * len(scene.train), np.concatenate(means)
            share = len(more) / (count + len(more))
            value = value + share * float(np.mean(more))
            spread = float(np.hypot((1.0 - share) * spread, share * np.std(more, ddof=1) / np.sqrt(len(more))))
    return abs(value) / spread if spread > 0.0 else np.inf


def _means(scene: Scene, fitted: Fitted, noises: Sequence[Noise], cause: Cause) -> list[Array] | None:
    """Return the load, or offset, that is left in every batch of each recording; None where none is told."""
    if not cause.effect.lasting or not colored(noises):
        return None
    found = []
    for index, residual in enumerate(fitted.residuals):
        told = _by_batches(scene, fitted, noises, cause, index, (residual,))
        if told is None:
            return None
        found.append(told[0][0])
    return found


def _times_pull(scene: Scene, fitted: Fitted, noises: Sequence[Noise], cause: Cause) -> float:
    """Return how many deviations an effect's loads by batches are; infinite where those are not what it does."""
    pulls, means = [], []
    bare = without(fitted, cause)[1].values
    for index, recording in enumerate(scene.train):
        start = fitted.point.starts[index]
        values = (fitted.point.values, bare)
        one, other = (scene.engine.simulate(recording, each, start) for each in values)
        done = np.nan_to_num(one - other)
        found = _by_batches(scene, fitted, noises, cause, index, (done, fitted.residuals[index]))
        if found is None or found[0][1] > _WITHIN:
            return np.inf
        pulls.append(found[0][0])
        means.append(found[1][0])
    spread = float(np.std(np.concatenate(means), ddof=1))
    return float(np.linalg.norm(np.concatenate(pulls))) / spread if spread > 0.0 else np.inf


def accidental(cause: Cause, times: float, gain: float) -> bool:
    """Tell whether a cause of so many deviations by batches may be no more than the average of a slow disturbance.

    `gain` is the drop of BIC it brought: where it is large, what batches differ by may be other physics.
    """
    return gain < FEW and times < (_CHANCE if cause.effect.lasting else _PULLED)


def by_chance(scene: Scene, fitted: Fitted, noises: Sequence[Noise], causes: Iterable[Cause], gain: float) -> bool:
    """Tell whether one of the causes, which brought `gain` together, may be such an average."""
    return gain < FEW and any(accidental(cause, times_chance(scene, fitted, noises, cause), gain) for cause in causes)


def with_lasting(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Widen deviations of loads and offsets to what slow disturbances leave, of limits to what rounding does."""
    told = deviations(replace(fitted, wider=None))
    least = {
        cause.keys[0]: max(deviation(scene, fitted, noises, cause), _rounded(cause))
        for cause in fitted.causes
        if cause.keys
    }
    factors = [
        least[each.name] / told[each.name] if each.name in least and told[each.name] > 0.0 else 1.0
        for each in fitted.coordinates
    ]
    return widened(fitted, np.array(factors))


def _rounded(cause: Cause) -> float:
    """Return the standard deviation that rounding leaves of the limit at which readings rest; 0 where none do.

    All are rounded alike there: no number of them tells more.
    """
    there = cause.output is not None and cause.effect.limits and cause.scales.rested > 0.0
    return (cause.scales.output - cause.scales.rested) / float(np.sqrt(12.0)) if there else 0.0


def _by_batches(
    scene: Scene, fitted: Fitted, noises: Sequence[Noise], cause: Cause, index: int, seen: Iterable[Array]
) -> list[tuple[Array, float]] | None:
    """Return for each of `seen` (n, r) the load, or offset, of every batch that makes it, and the share it leaves."""
    begins = batches(scene.train[index], _BATCHES)
    moves = pushed(scene, fitted, index, begins) if cause.output is None else _offsets(scene, cause, index, begins)
    return None if moves is None else sizes_of(scene, fitted, noises, index, moves, seen)


def _offsets(scene: Scene, cause: Cause, index: int, begins: Array) -> Array:
    """Return what an offset of one in each batch alone does to the outputs (n, r, batches)."""
    rows = scene.train[index].time
    found = np.zeros((len(rows), len(scene.plant.outputs), len(begins)))
    batch = np.searchsorted(begins, rows, side="right") - 1
    found[np.arange(len(rows)), [signal.name for signal in scene.plant.outputs].index(str(cause.output)), batch] = 1.0
    return found
