"""Choose the stretches of long recordings that find the basin of a fit; the fit itself takes every row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from firmloop.identify.fitting.experiment import Experiment, conditioned

_PLENTY = 100_000  # rows of all recordings together, up to which each of them is looked at
_STRETCH = 20_000  # rows; a start is free in each, and a plant sampled so fast that it does not answer within is none


def stretches(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Return the experiments as they are or, where they have more rows than plenty, where their outputs move most."""
    if sum(made.course.end - made.course.first for made in experiments) <= _PLENTY:
        return tuple(experiments)
    pieces = [piece for made in experiments for piece in _cut(made)]
    spread = np.std(np.concatenate([piece.measured for piece in pieces]), axis=0)
    motion = [
        float(np.sum((np.std(piece.measured, axis=0) / np.where(spread > 0, spread, 1)) ** 2)) for piece in pieces
    ]
    chosen, rows = [], 0
    for k in np.argsort(motion)[::-1]:
        if rows < _PLENTY:
            chosen.append(k)
            rows += len(pieces[k].measured)
    return tuple(replace(pieces[k], target=conditioned(pieces[k], pieces[k].measured)) for k in sorted(chosen))


def _cut(made: Experiment) -> list[Experiment]:
    """Cut an experiment into pieces of about equal length, which are not conditioned yet."""
    first, end = made.course.first, made.course.end
    edges = np.linspace(first, end, max(round((end - first) / _STRETCH), 1) + 1).astype(int).tolist()
    return [
        replace(
            made,
            course=replace(made.course, first=here, end=there),
            measured=made.measured[here - first : there - first],
        )
        for here, there in pairwise(edges)
    ]
