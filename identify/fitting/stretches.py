"""Choose the stretches of long recordings that find the basin of a fit; the fit itself takes every row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from firmloop.identify.fitting.experiment import Experiment, conditioned

_PLENTY = 100_000  # steps of simulation of all recordings together, up to which each row is looked at
_STRETCH = 20_000  # steps; a start is free in each, and a plant sampled so fast that it does not answer within is none
_FEWEST = 1_000  # rows of a stretch, however many steps each takes


def stretches(experiments: Sequence[Experiment], steps: Sequence[float]) -> tuple[Experiment, ...]:
    """Return the experiments as they are or, where they take more steps than plenty, where their outputs move most.

    `steps` are those that a simulation of each takes: its rows, or more where an effect is stiff.
    """
    if sum(steps) <= _PLENTY:
        return tuple(experiments)
    each = sum(steps) / sum(len(made.measured) for made in experiments)
    pieces = [piece for made in experiments for piece in _cut(made, max(_STRETCH / each, _FEWEST))]
    spread = np.std(np.concatenate([piece.measured for piece in pieces]), axis=0)
    motion = [
        float(np.sum((np.std(piece.measured, axis=0) / np.where(spread > 0, spread, 1)) ** 2)) for piece in pieces
    ]
    chosen, taken = [], 0.0
    for k in np.argsort(motion)[::-1]:
        if taken < _PLENTY:
            chosen.append(k)
            taken += each * len(pieces[k].measured)
    return tuple(replace(pieces[k], target=conditioned(pieces[k], pieces[k].measured)) for k in sorted(chosen))


def _cut(made: Experiment, rows: float) -> list[Experiment]:
    """Cut an experiment into equal pieces of about so many rows, which are not conditioned yet."""
    first, end = made.course.first, made.course.end
    edges = np.linspace(first, end, max(round((end - first) / rows), 1) + 1).astype(int).tolist()
    return [
        replace(
            made,
            course=replace(made.course, first=here, end=there),
            measured=made.measured[here - first : there - first],
        )
        for here, there in pairwise(edges)
    ]
