"""Read the range of a reading that wraps once more, from what an explanation leaves: at first nothing was known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diagnose.descent import slopes_of
from diagnose.hypothesis import Scene
from diagnose.rank import Search
from diagnose.wrap import shifted, turns_between
from identify.recording import Recording

Array = NDArray[np.float64]

_SURE = 3.0  # deviations from which a range was off


def regauged(found: Search, train: Sequence[Recording], test: Sequence[Recording]) -> Scene | None:
    """Return the scene with every range as the best explanation tells it; None where none is off.

    `train` and `test` are the recordings as they were read, before they were unrolled.
    """
    scene, outputs = found.scene, [signal.name for signal in found.scene.plant.outputs]
    moved, directs = [[*scene.train], [*scene.test]], list(scene.direct)
    for number, direct in enumerate(scene.direct):
        if direct.effect != "sensor_wrap":
            continue
        turns = [
            [turns_between(*pair, direct.output, direct.values[0]) for pair in zip(before, after, strict=True)]
            for before, after in zip((train, test), moved, strict=True)
        ]
        change, deviation = _off(found, outputs.index(direct.output), turns[0])
        if abs(change) > _SURE * deviation:
            reach, start = direct.values
            directs[number] = replace(
                direct, values=(reach + change, start), deviations=(deviation, direct.deviations[1])
            )
            for place, parts in enumerate(turns):
                moved[place] = [
                    shifted(each, direct.output, change * turn) for each, turn in zip(moved[place], parts, strict=True)
                ]
    if directs == list(scene.direct):
        return None
    return replace(scene, train=tuple(moved[0]), test=tuple(moved[1]), direct=tuple(directs), memory={})


def _off(found: Search, index: int, turns: Sequence[Array]) -> tuple[float, float]:
    """Return by how much the range of output `index` is too small, and the deviation of that, beside all unknowns."""
    scene, best = found.scene, found.best
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
