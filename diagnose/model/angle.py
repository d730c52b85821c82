"""Which angle waves per turn follow: the simulated one, or the recorded one without what its sensor does to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.model.fit import Fitted, doubted, evidence, fit, own_evidence
from firmloop.diagnose.model.hypothesis import Problem, follows_simulated, periods_of, turning
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.policy import STEPS_OF_A_FIT
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.simulation.linear_filter import integrated

Array = NDArray[np.float64]

_TOLD = ("position_rad", "speed_rad_s")  # what tells an angle, the first before the second


def follows_record(problem: Problem, nominal: Candidate) -> bool:
    """Tell whether waves per turn had better follow the recorded angle than the simulated one.

    A recorded position always; the integral of a recorded speed where the simulated angle is further from it than the
    noise of the speed can bring it.
    """
    for recording, residual in zip(problem.train, nominal.fitted.residuals, strict=True):
        if "position_rad" in recording.columns:
            return True
        for index, signal in enumerate(problem.plant.outputs):
            if signal.name == "speed_rad_s":
                step = float(np.median(np.diff(recording.time)))
                drift = np.cumsum(residual[:, index]) * step
                walk = float(np.median(np.abs(np.diff(residual[:, index])))) * step * np.sqrt(len(residual))
                if float(np.std(drift)) > walk:
                    return True
    return False


def lost(problem: Problem, nominal: Candidate) -> float:
    """Return the rms (rad) by which the simulated angle is off, in the recording where that is most."""
    names = [signal.name for signal in problem.plant.outputs]
    told = next((name for name in _TOLD if name in names), None)
    if told is None:
        return math.inf
    most = 0.0
    for recording, residual in zip(problem.train, nominal.fitted.residuals, strict=True):
        off = residual[:, names.index(told)]
        if told != _TOLD[0]:
            off = integrated(off, recording.time)
        most = max(most, float(np.sqrt(np.mean(off**2))))
    return most


def strayed(problem: Problem, candidate: Candidate) -> Mapping[int, Array]:
    """Return how far recorded angles (n,) are off by what was found of their sensor and of the clock; none by nothing.

    Of an angle that is the integral of a speed that sensor is the speed's.
    """
    names = [signal.name for signal in problem.plant.outputs]
    told = next((name for name in _TOLD if name in problem.train[0].columns), None)
    point = candidate.fitted.point
    wrong = {
        key
        for term in candidate.fitted.terms
        for key in term.keys
        if term.output == told or term.effect.place == "timing"
    }
    if told not in names or not wrong:
        return {}
    bare = {key: value for key, value in point.values.items() if key not in wrong}
    found = {}
    for recording, start in zip(problem.train, point.starts, strict=True):
        seen, true = (
            problem.engine.simulate(recording, each, start)[:, names.index(told)] for each in (point.values, bare)
        )
        off = np.nan_to_num(seen - true)
        found[id(recording)] = off if told == _TOLD[0] else integrated(off, recording.time)
    return found


def with_walk(problem: Problem, fitted: Fitted) -> Fitted:
    """Widen deviations of waves that follow the integral of a speed by how far its noise lets that walk off.

    What of the walk is a line along the angle is an error of the periods and the phase; what is left of it smears the
    wave, which seems smaller.
    """
    waves = [term for term in fitted.terms if turning([term])]
    names = [signal.name for signal in problem.plant.outputs]
    followed = problem.engine.recorded and not any(_TOLD[0] in each.columns for each in problem.train)
    if not waves or not followed or _TOLD[1] not in names:
        return fitted
    noise = sensor_noises(fitted.residuals, problem.floors)[names.index(_TOLD[1])]
    angles = [problem.engine.angle(recording) for recording in problem.train]
    steps = [noise * float(np.median(np.diff(recording.time))) for recording in problem.train]
    spread, smeared = walked([each for each in angles if each is not None], steps)
    further = {}
    for term in waves:
        values = fitted.point.values
        if follows_simulated(problem, term, values):
            continue
        periods = periods_of(term, values)
        size = 1.0 - math.exp(-0.5 * smeared * periods**2)
        further[term.keys[0]] = abs(values[term.keys[0]]) * size / NORMAL_95
        for key in term.keys[1:]:
            further[key] = periods * math.sqrt(spread[0, 0] if key.endswith(".phase_rad") else spread[1, 1])
    return doubted(fitted, further)


def walked(angles: Sequence[Array], steps: Sequence[float]) -> tuple[Array, float]:
    """Return what random walks do to lines a + b angle through them: the covariance (2, 2) of a and b, and the rest.

    `angles` (n,) in rad are those of each recording, `steps` the rms of one step of its walk; the rest is a variance.
    """
    square, filling, total = np.zeros((2, 2)), np.zeros((2, 2)), 0.0
    for angle, step in zip(angles, steps, strict=True):
        line = np.stack([np.ones(len(angle)), angle], axis=1)
        after = step * np.cumsum(line[::-1], axis=0)[::-1]  # what one step does to all that follows
        square += line.T @ line
        filling += after.T @ after
        total += 0.5 * (step * len(angle)) ** 2
    inverted = np.linalg.pinv(square)
    left = max(total - float(np.trace(inverted @ filling)), 0.0)
    return inverted @ filling @ inverted, left / sum(map(len, angles))


def lost_count(problem: Problem, candidate: Candidate, base: Candidate) -> bool:
    """Tell whether the newest effect only makes up for what the integral of a noisy speed has lost.

    Without it, waves that follow the simulated angle explain the train recordings as well.
    """
    angles = any("position_rad" in recording.columns for recording in problem.train)
    if not problem.engine.recorded or angles or not turning(base.fitted.terms):
        return False
    problem.engine.follow(False)
    other = fit(problem, problem.train, base.fitted.terms, base.fitted.point, base.noises, STEPS_OF_A_FIT)
    problem.engine.follow(True)
    return own_evidence(problem, other) <= evidence(candidate.fitted, candidate.noises)
