"""Find how often per turn a torque repeats: waves of the measured angle through the linear plant, no simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from diagnose.hypothesis import Scene
from diagnose.refit import Fitted, whitened
from diagnose.response import disturbed, effort_of
from diagnose.screen import Ground, orthogonal
from identify.linear import linearize
from identify.superset import travelled

Array = NDArray[np.float64]

_HIGHEST = 48
_KEPT = 2


def best_orders(scene: Scene, base: Fitted, grounds: Sequence[Ground]) -> Mapping[str, tuple[float, ...]]:
    """Return the waves per turn that promise most under any of the grounds, best first, by the name of the effect."""
    plant = scene.plant
    turning = [index for index, balance in enumerate(plant.balances) if balance.kind == "torque"]
    if not turning or not np.all(np.isfinite(linearize(plant).a)):
        return {}
    angles = [angle for angle in map(travelled, scene.train) if angle is not None]
    if len(angles) < len(scene.train):
        return {}
    efforts = [effort_of(plant, base.point.values, recording) for recording in scene.train]
    found = {}
    for name, sizes in (("cogging_torque", [np.ones(len(angle)) for angle in angles]), ("torque_ripple", efforts)):
        gains = np.zeros((len(grounds), _HIGHEST))
        for order in range(1, _HIGHEST + 1):
            waves = [
                disturbed(
                    plant,
                    base.point.values,
                    recording,
                    np.stack([size * np.sin(order * angle), size * np.cos(order * angle)], 1),
                )
                for recording, angle, size in zip(scene.train, angles, sizes, strict=True)
            ]
            for index, under in enumerate(grounds):
                tall = np.concatenate([whitened(wave, under.noises) for wave in waves])
                pure = tall - under.basis @ (under.basis.T @ tall)
                if np.all(np.linalg.norm(pure, axis=0) > 1e-6 * np.linalg.norm(tall, axis=0)):
                    gains[index, order - 1] = float(np.sum((orthogonal(pure).T @ under.left) ** 2))
        best = [float(np.argsort(-row)[rank] + 1) for rank in range(_KEPT) for row in gains]
        found[name] = tuple(dict.fromkeys(best))
    return found
