"""Unroll a reading that wraps once more, by what explains the rest: at first nothing was known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.descent import slopes_of
from firmloop.diagnose.hypothesis import Scene
from firmloop.diagnose.rank import Search
from firmloop.diagnose.refit import fit, noises_of
from firmloop.diagnose.rival import Rival, unseen_residuals
from firmloop.diagnose.round import LONG
from firmloop.diagnose.wrap import shifted, turns_between
from firmloop.identify.fitting.noise import flat
from firmloop.identify.plants.effects import effect_seen_by
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]

_SURE = 3.0  # deviations from which a range was off
_NEAR, _MOST = 0.25, 0.9  # of a range, and of all readings: so near an explanation is, that can count their turns
_ROUNDS = 6  # of counting turns, each by a fit to what the last has counted


def regauged(found: Search, train: Sequence[Recording], test: Sequence[Recording]) -> Scene | None:
    """Return the scene with how often readings wrapped, and every range, as the best explanation tells it.

    None where it tells the same. `train` and `test` are the recordings as they were read, before they were unrolled.
    """
    given, best = found.scene, found.best
    scene = given
    for number, direct in enumerate(given.direct):
        if direct.effect != effect_seen_by("wraps").name:
            continue
        index = [signal.name for signal in scene.plant.outputs].index(direct.output)
        for _ in range(_ROUNDS):
            counted = _recounted(scene, best, (*train, *test), index, direct.values[0])
            if counted is None:
                break
            scene = counted
            fitted = fit(scene, scene.train, best.fitted.causes, best.fitted.point, flat(best.noises), LONG)
            best = Rival(fitted, noises_of(scene, fitted.residuals), best.score)
        turns = [
            turns_between(before, after, direct.output, direct.values[0])
            for before, after in zip((*train, *test), (*scene.train, *scene.test), strict=True)
        ]
        off, deviation = _off(scene, best, index, turns[: len(train)])
        if abs(off) > _SURE * deviation:
            values, deviations = (direct.values[0] + off, direct.values[1]), (deviation, direct.deviations[1])
            known = replace(direct, values=values, deviations=deviations)
            directs = (*scene.direct[:number], known, *scene.direct[number + 1 :])
            scene = replace(_moved(scene, direct.output, [off * turn for turn in turns]), direct=directs)
    return None if scene is given else scene


def _recounted(scene: Scene, best: Rival, raw: Sequence[Recording], index: int, reach: float) -> Scene | None:
    """Return the scene with readings moved by as many ranges as brings each near an explanation.

    None where none is to be moved, or the explanation is not near most of them even so.
    """
    output = scene.plant.outputs[index].name
    residuals = (*best.fitted.residuals, *unseen_residuals(scene, best.fitted, best.noises))
    changes, near = [], []
    for before, after, residual in zip(raw, (*scene.train, *scene.test), residuals, strict=True):
        simulated = after.columns[output] - residual[:, index]
        unrolled = before.columns[output] + reach * np.round((simulated - before.columns[output]) / reach)
        near.append(np.abs(unrolled - simulated) < _NEAR * reach)
        changes.append(reach * np.round((unrolled - after.columns[output]) / reach))
    if not any(np.any(change) for change in changes) or float(np.mean(np.concatenate(near))) < _MOST:
        return None
    return _moved(scene, output, changes)


def _moved(scene: Scene, output: str, changes: Sequence[Array]) -> Scene:
    """Return the scene with changes (n,) of an output's readings in every recording."""
    whole = [shifted(each, output, change) for each, change in zip((*scene.train, *scene.test), changes, strict=True)]
    count = len(scene.train)
    return replace(scene, train=tuple(whole[:count]), test=tuple(whole[count:]), memory={})


def _off(scene: Scene, best: Rival, index: int, turns: Sequence[Array]) -> tuple[float, float]:
    """Return by how much the range of output `index` is too small, and the deviation of that, beside all unknowns."""
    sizes = np.array([noise.rms for noise in best.noises])
    count = len(best.fitted.coordinates)
    tall, left = [], []
    for k, (recording, residual, turn) in enumerate(zip(scene.train, best.fitted.residuals, turns, strict=True)):
        slopes = slopes_of(scene, recording, best.fitted.coordinates, best.fitted.point, k, residual)[..., :count]
        own = np.zeros((*residual.shape, 1))
        own[:, index, 0] = -turn
        tall.append((np.concatenate([own, slopes], axis=2) / sizes[:, None]).reshape(residual.size, -1))
        left.append((residual / sizes).ravel())
    columns = np.concatenate(tall)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    answer = np.linalg.lstsq(columns / scale, np.concatenate(left), rcond=1e-9)[0] / scale
    spread = np.sqrt(np.diag(np.linalg.pinv((columns / scale).T @ (columns / scale), rcond=1e-12))) / scale
    return float(answer[0]), float(spread[0])
