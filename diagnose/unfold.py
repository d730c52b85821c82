"""Give a reading that has lost its sign back the likely one, so that a fit can begin on the right side of zero."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from diagnose.descent import residual_of
from diagnose.hypothesis import Cause, Point, Scene, entered, first_point, outputs_of
from diagnose.refit import Fitted, fit, noises_of
from identify.noise import flat, white
from identify.recording import Recording

Array = NDArray[np.float64]

_ROUNDS = 3  # of giving signs, each by a fit to what the last has given
_LONG, _SHORT = 24, 6  # steps of such a fit, and of one beside the cause
_BEND, _AWAY = 3.0, 0.03  # what a row may cost: usual changes of slope, and shares of being as far as the reading goes
_MOST = 30.0  # usual changes of slope, more than which count no more


def from_unfolded(scene: Scene, cause: Cause) -> Fitted:
    """Fit the nominal plant to readings with the likely sign, and from there the cause that has taken it away."""
    output = str(cause.output)
    index = [signal.name for signal in scene.plant.outputs].index(output)
    point = first_point(scene, scene.train)
    expected = [
        outputs_of(scene, each)[:, index] - residual_of(scene, each, point, k)[:, index]
        for k, each in enumerate(scene.train)
    ]
    noises = None
    for _ in range(_ROUNDS):
        signed = tuple(_signed(each, output, near) for each, near in zip(scene.train, expected, strict=True))
        part = replace(scene, train=signed, memory={})
        if noises is None:
            spreads = np.std(np.concatenate([outputs_of(scene, each) for each in signed]), axis=0)
            noises = tuple(white(max(float(size), 1e-12)) for size in spreads)
        one = fit(part, signed, (), point, noises, _LONG)
        noises = flat(noises_of(scene, one.residuals))
        one = fit(part, signed, (), one.point, noises, _LONG)
        point = one.point
        expected = [
            outputs_of(scene, each)[:, index] - left[:, index] for each, left in zip(signed, one.residuals, strict=True)
        ]
    values = entered(point.values, cause, scene.starts[cause.label][0])
    return fit(scene, scene.train, (cause,), Point(values, point.starts), noises or (), _SHORT)


def _signed(recording: Recording, output: str, expected: Array) -> Recording:
    signs = _signs(recording.columns[output], expected)
    columns = {**recording.columns, output: np.ascontiguousarray(signs * recording.columns[output])}
    return replace(recording, columns=MappingProxyType(columns))


def _signs(seen: Array, expected: Array) -> Array:
    """Return the signs (n,) by which a reading bends little and goes where it is expected.

    The cheapest way through all rows (Viterbi 1967), whose places are the signs of a row and of the one before.
    """
    pairs = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])  # (this, before)
    follows = pairs[None, :, 1] == pairs[:, None, 0]  # from, to
    usual = max(float(np.median(np.abs(np.diff(seen, 2)))), 1e-12)
    size = max(float(np.max(np.abs(seen))), 1e-12)
    away = _AWAY * np.abs(pairs[None, :, 0] * seen[:, None] - np.nan_to_num(expected)[:, None]) / size
    cost = away[1].copy()
    came = np.zeros((len(seen), len(pairs)), dtype=np.int64)
    # The bend of three rows with the signs (this, before) of the new place and (before that) of the old one.
    for row in range(2, len(seen)):
        bend = (
            pairs[None, :, 0] * seen[row] - 2.0 * pairs[None, :, 1] * seen[row - 1] + pairs[:, None, 1] * seen[row - 2]
        )
        ways = np.where(follows, cost[:, None] + np.minimum(np.abs(bend) / (_BEND * usual), _MOST), np.inf)
        came[row] = np.argmin(ways, axis=0)
        cost = ways[came[row], np.arange(len(pairs))] + away[row]
    place = int(np.argmin(cost))
    signs = np.ones(len(seen))
    for row in range(len(seen) - 1, 1, -1):
        signs[row], signs[row - 1] = pairs[place]
        place = int(came[row, place])
    signs[1], signs[0] = pairs[place]
    return signs
