"""Find out what the input did between its rows, by fits of the nominal plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import HOLD_GAIN, HOLD_HALVES, HOLD_RMS, HOLD_TRACE, STEPS_OF_A_NOMINAL_FIT
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.experiment import Experiment, best_start, experiments
from firmloop.identify.fitting.noise import fit_noise
from firmloop.identify.fitting.problem import FitPoint, FitProblem, make_problem, solve, weighted
from firmloop.identify.fitting.projection import outside, with_starts
from firmloop.identify.plants.attach import all_uses, with_effects
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.hold import HOLDS
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import constants_of, rest_start, simulator

Array = NDArray[np.float64]


def believed_hold(plant: Plant, train: Sequence[Recording]) -> str:
    """Return what the recordings say if they were told to be held; another hold has to explain them clearly better.

    A hold changes the nominal simulation a little. Where that change stands in the residual in about its own size, the
    nominal plant is fitted under every hold, and the evidence decides.
    """
    given = train[0].hold
    even = all(np.ptp(np.diff(evened(each.time))) < 1e-6 * np.ptp(each.time) / len(each.time) for each in train)
    if given != HOLDS[0] or not even or any(np.isnan(p.value) for p in plant.parameters):
        return given
    try:
        shares = _shares(plant, train)
        if not all(HOLD_TRACE[0] < share < HOLD_TRACE[1] for share in shares) or max(shares) > HOLD_HALVES * min(
            shares
        ):
            return given
        tried = {hold: _evidence(plant, [replace(each, hold=hold) for each in train]) for hold in HOLDS}
        best = min(tried, key=lambda hold: tried[hold][0])
        clear = tried[best][0] < tried[given][0] - HOLD_GAIN and tried[best][1] < HOLD_RMS * tried[given][1]
        return best if clear and not _drifts(plant, train, tried[best][0]) else given
    except IdentifyError:
        return given  # preflight will say it better


def _drifts(plant: Plant, train: Sequence[Recording], evidence: float) -> bool:
    """Tell whether a clock of another rate explains the recordings as given better: it may be half a row off."""
    there = {use.name for use in plant.effects}
    clocks = [use for use in all_uses(plant) if find_effect(use.name).place == "timing" and use.name not in there]
    freed = [replace(use, free=tuple(use.values)) for use in clocks]
    return any(_evidence(with_effects(plant, (*plant.effects, use)), train)[0] < evidence for use in freed)


def _shares(plant: Plant, train: Sequence[Recording]) -> tuple[float, ...]:
    """Return how much of what a straight-line hold would change stands in the residual of the fitted nominal plant.

    In all, in the first halves and in the second halves of the recordings: a hold does the same throughout, and a clock
    that runs at another rate does not.
    """
    problem, point, pairs = fitted_nominal(plant, train)
    count = len(problem.free)
    lefts, talls, secants = [], [], []
    drawn = [part for each in train for part in experiments(plant, replace(each, hold="linear"), NONE)]
    engine = simulator(plant, "linear")
    lot = len(drawn)
    for k, ((residual, slopes), made, start) in enumerate(zip(pairs, drawn, point.starts, strict=True)):
        moved = (made.target - engine.run(made.course, point.constants, start)) * problem.weights
        lefts.append(residual.reshape(-1))
        secants.append((residual - moved).reshape(-1))
        talls.append(with_starts(slopes, count, k, lot).reshape(residual.size, -1))
    left, secant, tall = np.concatenate(lefts), np.concatenate(secants), np.concatenate(talls)
    if not (np.all(np.isfinite(secant)) and np.all(np.isfinite(tall))):
        return (0.0,)
    norms = np.linalg.norm(tall, axis=0)
    basis, _ = np.linalg.qr(tall[:, norms > 0.0] / norms[norms > 0.0])
    left, secant = outside(basis, left), outside(basis, secant)
    early = np.concatenate([np.arange(len(each)) < len(each) // 2 for each in lefts])
    parts = [secant * left, secant**2]
    sums = [[float(np.sum(part[rows])) for part in parts] for rows in (np.full(len(left), True), early, ~early)]
    return tuple(both / own if own > 0.0 else 0.0 for both, own in sums)


def _evidence(plant: Plant, train: Sequence[Recording]) -> tuple[float, float]:
    """Return -2 log likelihood (but for a constant) and residual rms over spread of the fitted nominal plant."""
    problem, _, pairs = fitted_nominal(plant, train)
    total, power = 0.0, 0.0
    for index in range(len(plant.outputs)):
        parts = [residual[:, index] for residual, _ in pairs]
        rows = sum(len(part) for part in parts)
        noise = fit_noise(parts, 1e-12)
        total += 2.0 * rows * float(np.log(noise.scale / problem.weights[index]))
        power += noise.rms**2
    return total, float(np.sqrt(power))


def fitted_nominal(
    plant: Plant, train: Sequence[Recording], steps: int = STEPS_OF_A_NOMINAL_FIT
) -> tuple[FitProblem, FitPoint, list[tuple[Array, Array]]]:
    """Fit the nominal plant from where it is given."""
    engine = simulator(plant, train[0].hold)
    parts: list[Sequence[Experiment]] = [experiments(plant, recording, NONE) for recording in train]
    problem = make_problem(plant, engine, parts)
    constants = constants_of(plant)
    starts = [
        best_start(made, engine, constants, rest_start(plant, recording), problem.weights)
        for made, recording in zip(problem.experiments, train, strict=True)
    ]
    point, _ = solve(problem, FitPoint(constants, np.stack(starts)), steps)
    return problem, point, list(weighted(problem, point))
