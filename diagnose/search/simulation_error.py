"""Look at simulation error plainly: whether a slow misfit is left, and which explanation simulates nearer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import memories, rms_of
from firmloop.diagnose.model.fit import Fitted
from firmloop.diagnose.model.hypothesis import LibraryTerm
from firmloop.diagnose.policy import LOST_SHARE, NEARER_RMS, SLOW_RMS
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.noise import Noise

Array = NDArray[np.float64]


def strays(found: Search) -> bool:
    """Tell whether an explanation leaves so large a slow misfit beside the motion that it follows nothing."""
    problem, noises = found.problem, found.best.noises
    spreads = [np.concatenate([each.columns[s.name] for each in problem.train]).std() for s in problem.plant.outputs]
    large = any(noise.rms > LOST_SHARE * spread for noise, spread in zip(noises, spreads, strict=True))
    return large and max(noise.rms / noise.scale for noise in noises) > SLOW_RMS


def independent(residuals: Sequence[Array]) -> tuple[Noise, ...]:
    """Return white noise whose scale is that of the mean of independent samples: rms times sqrt(1 + 2 sum rho^2)."""
    made = []
    for index, kept in enumerate(memories(residuals)):
        rms = max(float(np.sqrt(np.mean(np.concatenate([part[:, index] for part in residuals]) ** 2))), 1e-30)
        made.append(Noise(np.zeros(0), rms * float(np.sqrt(kept)), rms))
    return tuple(made)


def nearest(base: Fitted, others: Sequence[Fitted]) -> Fitted:
    """Return the one of several whose simulations leave least, each output in units of what a base leaves."""
    return min(others, key=lambda each: _ratio(each.residuals, base.residuals))


def nearer(one: Fitted, other: Fitted, share: float = NEARER_RMS) -> bool:
    """Tell whether the simulations of one explanation leave less than a share of another's."""
    return _ratio(one.residuals, other.residuals) < share


def needed(fitted: Fitted, slim: Fitted, gone: LibraryTerm) -> bool:
    """Tell whether simulations come so much nearer by a term than without, `slim`, that no disturbance is all it is.

    What lasts soaks up what drifts, too.
    """
    return not gone.effect.lasting and nearer(fitted, slim)


def _ratio(one: Sequence[Array], other: Sequence[Array]) -> float:
    """Return the rms of one set of residuals over that of another, the mean over outputs of their squares."""
    ours, theirs = (rms_of(parts) for parts in (one, other))
    ratios = np.nan_to_num(ours / np.maximum(theirs, 1e-150), nan=np.inf, posinf=np.inf)
    return float(np.sqrt(np.mean(ratios**2)))
