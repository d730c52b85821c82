"""A residual that drifts: a zero that wanders, a plant that warms up.

A constant beside the line is no drift, and hides none: of a zero that wanders from where it was, both are left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, Explanation, Remainder, explained, left_after, remainders
from firmloop.identify.fitting.residual_tests import independent

Array = NDArray[np.float64]

_SHARE = 0.3  # of what is left
_CERTAIN = 24.0  # by which twice the log likelihood rises: many slow noises look like a line for a while


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each output whether a straight line over time explains what is left."""
    assert evidence.fit is not None
    plant, parts = evidence.fit.plant, remainders(evidence)
    weights = np.array([1.0 / max(evidence.fit.noise[o.name], 1e-300) for o in plant.outputs])
    found = []
    for k, output in enumerate(plant.outputs):
        if output.name in evidence.conditioning.detrend:
            continue
        columns = [_alone(part, k, part.time - part.time.mean()) for part in parts]
        steady = [_with_constant(part, k) for part in parts]
        line = explained(steady, weights, columns)
        rest = left_after(line, steady, weights, columns)
        share = _of_its_output(line, rest, k)
        if (
            share < _SHARE
            or -independent([left[:, k] for left in rest]) * math.log(max(1.0 - share, 1e-300)) < _CERTAIN
        ):
            continue
        span = max(float(np.ptp(part.time)) for part in parts)
        moves = max(float(np.ptp(each.columns[output.name])) for each in evidence.recordings)
        if abs(line.size) * span > moves:
            continue  # where each window begins anew a line is hardly seen, and what looks like one is no drift
        found.append(
            f"what {plant.kind} leaves of {output.name} drifts by {line.size * span:.3g} {output.unit} in {span:.3g} s"
            ": ask firmloop diagnose what changes, let the plant warm up first, or, if only the zero of its sensor "
            f'wanders, write detrend = ["{output.name}"] in [recordings.conditioning]'
        )
    return tuple(found)


def _of_its_output(line: Explanation, rest: Sequence[Array], k: int) -> float:
    """Return the share of what is left of output k that the line explains: noise of other outputs hides none of it."""
    every, own = (float(sum(np.sum(left**2) for left in parts)) for parts in (rest, [left[:, k] for left in rest]))
    explains = every * line.share / max(1.0 - line.share, 1e-300)
    return explains / max(explains + own, 1e-300)


def _alone(part: Remainder, k: int, values: Array) -> Array:
    """Return values (q,) of one output as a column (q, r) of all."""
    column = np.zeros_like(part.residual)
    column[:, k] = values
    return column


def _with_constant(part: Remainder, k: int) -> Remainder:
    """Let one output have a constant, which a fit would take."""
    constant = _alone(part, k, np.ones(len(part.residual)))
    return replace(part, slopes=np.concatenate([part.slopes, constant[..., None]], axis=2))


CHECK = Check("drift", look, ("structure",), True)
