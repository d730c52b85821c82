"""Look at simulation error plainly: whether a slow misfit is left, and which explanation simulates nearer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate, memories, rms_of
from firmloop.diagnose.model.fit import Fitted
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem, outputs_of
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.policy import COLORED_SENSOR, LOST_SHARE, NEARER_RMS, SLOW_RMS, STILL_MISSING
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.checks.structure import answering, features
from firmloop.identify.fitting.noise import Noise, oversized
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import Plant

Array = NDArray[np.float64]


def strays(found: Search) -> bool:
    """Tell whether an explanation leaves so large a slow misfit beside the motion that it follows nothing."""
    problem, noises = found.problem, found.best.noises
    spreads = [np.concatenate([each.columns[s.name] for each in problem.train]).std() for s in problem.plant.outputs]
    large = any(noise.rms > LOST_SHARE * spread for noise, spread in zip(noises, spreads, strict=True))
    return large and max(noise.rms / noise.scale for noise in noises) > SLOW_RMS


def unlike_noise(problem: Problem, candidate: Candidate) -> bool:
    """Tell whether an explanation leaves more than noise may be, or far more of some output than its sensor's own."""
    return oversized(candidate.noises) or beyond_sensors(problem, candidate.fitted.residuals)


def misfits(search: Search) -> bool:
    """Tell whether the input explains some of what the best leaves in most recordings, where that is unlike noise."""
    return unlike_noise(search.problem, search.best) and mostly(_answers_of(search))


def answers(search: Search) -> bool:
    """Tell whether the input explains some of what the best leaves in a recording, more than sensors' noise."""
    residuals = search.best.fitted.residuals
    sensors = np.array(sensor_noises(residuals, search.problem.floors))
    return bool(np.any(rms_of(residuals) > STILL_MISSING * sensors)) and any(_answers_of(search))


def _answers_of(search: Search) -> list[bool]:
    """Tell of each recording whether the input explains some of what the best leaves; of none where no one input is."""
    if search.refit is None or len(search.refit.inputs) != 1:
        return []
    return answered(search.problem, search.refit, dict(enumerate(search.best.fitted.residuals)), noisy=False)


def mostly(answers: Sequence[bool]) -> bool:
    """Tell whether more than half of the answers are yes."""
    return 2 * sum(answers) > len(answers)


def answered(problem: Problem, refit: Plant, lefts: Mapping[int, Array], noisy: bool) -> list[bool]:
    """Tell of recordings, by their places, whether the input explains some of what is left (n, r) of any output.

    `noisy` where that may be noise, see `explained_share`. What is far more than its sensors' noise where no input
    changes is a machine's own motion: it answers its start.
    """
    plant, found, drive = with_effects(refit, ()), [], refit.inputs[0].name
    for k, left in lefts.items():
        if np.all(np.isfinite(left)):
            recording = problem.train[k]
            given = features(plant, recording, outputs_of(problem, recording) - left)
            own = np.ptp(recording.columns[drive]) == 0.0 and beyond_sensors(problem, [left])
            found.append(own or any(answering(column, given, noisy) > 0.0 for column in left.T))
    return found


def beyond_sensors(problem: Problem, residuals: Sequence[Array]) -> bool:
    """Tell whether residuals (n, r) of several recordings are far more than the own noise of some output's sensor."""
    return bool(np.any(rms_of(residuals) > COLORED_SENSOR * np.array(sensor_noises(residuals, problem.floors))))


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
