"""Make recordings ready to be searched: keep what a search can afford, and find out what the input did between rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diagnose.noise import fit_noise
from identify.clock import evened
from identify.condition import NONE
from identify.experiment import Experiment, best_start, experiments
from identify.forms import form_writer
from identify.hold import FINER, HOLDS
from identify.plant import IdentifyError, Plant
from identify.problem import Point, Problem, make_problem, solve, weighted
from identify.recording import Recording, make_recording
from identify.simulate import constants_of, rest_start, simulator

Array = NDArray[np.float64]

_MOST_ROWS = 30_000  # straight pieces of input over all recordings of one role
_BENT = 8  # times as long takes a row of a plant whose equations are not linear
_PLACES = 8  # where a stretch of a long recording may begin
_STEPS = 12  # of a fit of the nominal plant
_LIKE = (0.5, 2.0)  # share of a hold's trace that is found in the residual, from which it is worth fits of its own
_ALIKE = 1.15  # ratio of that share in the first and second halves of the recordings
_WORTH = 60.0  # drop of -2 log likelihood from which a hold is believed; a controller's output is held, as a rule
_SMALLER = 0.98  # ratio of residual rms which that has to bring


def prepared(
    plant: Plant, train: Sequence[Recording], test: Sequence[Recording]
) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Return the recordings to search, those that are too long cut to their liveliest stretch."""
    hold = believed_hold(plant, shortened(plant, train, _MOST_ROWS // (2 * FINER))) if train else HOLDS[0]
    rows = _MOST_ROWS // (2 * FINER if hold == "band_limited" else 1)
    if not form_writer(plant).linear_rate:
        rows = rows // _BENT
    seen, unseen = (shortened(plant, part, rows) for part in (train, test))
    return tuple(replace(each, hold=hold) for each in seen), tuple(replace(each, hold=hold) for each in unseen)


def shortened(plant: Plant, recordings: Sequence[Recording], rows: int) -> tuple[Recording, ...]:
    """Cut every recording in the same proportion, so that all have `rows` rows together; short ones stay."""
    total = sum(len(recording.time) for recording in recordings)
    if total <= rows:
        return tuple(recordings)
    names = [signal.name for signal in plant.outputs]
    cut = []
    for recording in recordings:
        keep = int(len(recording.time) * rows / total)
        places = np.unique(np.linspace(0, len(recording.time) - keep, _PLACES).astype(int))
        lively = [
            sum(float(np.std(recording.columns[n][p : p + keep]) / np.std(recording.columns[n])) for n in names)
            for p in places
            if all(n in recording.columns and np.ptp(recording.columns[n]) > 0.0 for n in names)
        ]
        place = int(places[int(np.argmax(np.round(lively, 2)))]) if lively else 0
        columns = {name: column[place : place + keep] for name, column in recording.columns.items()}
        part = make_recording(recording.time[place : place + keep], columns, recording.source, recording.sha256)
        cut.append(replace(part, hold=recording.hold))
    return tuple(cut)


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
        if not all(_LIKE[0] < share < _LIKE[1] for share in shares) or max(shares) > _ALIKE * min(shares):
            return given
        tried = {hold: _evidence(plant, [replace(each, hold=hold) for each in train]) for hold in HOLDS}
    except IdentifyError:
        return given  # preflight will say it better
    best = min(tried, key=lambda hold: tried[hold][0])
    clear = tried[best][0] < tried[given][0] - _WORTH and tried[best][1] < _SMALLER * tried[given][1]
    return best if clear else given


def _shares(plant: Plant, train: Sequence[Recording]) -> tuple[float, ...]:
    """Return how much of what a straight-line hold would change stands in the residual of the fitted nominal plant.

    In all, in the first halves and in the second halves of the recordings: a hold does the same throughout, and a clock
    that runs at another rate does not.
    """
    problem, point, pairs = _fitted(plant, train)
    count = len(problem.free)
    lefts, talls, secants = [], [], []
    drawn = [part for each in train for part in experiments(plant, replace(each, hold="linear"), NONE)]
    engine = simulator(plant, "linear")
    lot = len(drawn)
    for k, ((residual, slopes), made, start) in enumerate(zip(pairs, drawn, point.starts, strict=True)):
        moved = (made.target - engine.run(made.course, point.constants, start)) * problem.weights
        wide = np.zeros((residual.size, count + lot * len(start)))
        flat = slopes.reshape(residual.size, -1)
        wide[:, :count] = flat[:, :count]
        wide[:, count + k * len(start) : count + (k + 1) * len(start)] = flat[:, count:]
        lefts.append(residual.reshape(-1))
        secants.append((residual - moved).reshape(-1))
        talls.append(wide)
    left, secant, tall = np.concatenate(lefts), np.concatenate(secants), np.concatenate(talls)
    if not (np.all(np.isfinite(secant)) and np.all(np.isfinite(tall))):
        return (0.0,)
    norms = np.linalg.norm(tall, axis=0)
    basis, _ = np.linalg.qr(tall[:, norms > 0.0] / norms[norms > 0.0])
    left, secant = (each - basis @ (basis.T @ each) for each in (left, secant))
    early = np.concatenate([np.arange(len(each)) < len(each) // 2 for each in lefts])
    parts = [secant * left, secant**2]
    sums = [[float(np.sum(part[rows])) for part in parts] for rows in (np.full(len(left), True), early, ~early)]
    return tuple(both / own if own > 0.0 else 0.0 for both, own in sums)


def _evidence(plant: Plant, train: Sequence[Recording]) -> tuple[float, float]:
    """Return -2 log likelihood (but for a constant) and residual rms over spread of the fitted nominal plant."""
    problem, _, pairs = _fitted(plant, train)
    total, power = 0.0, 0.0
    for index in range(len(plant.outputs)):
        parts = [residual[:, index] for residual, _ in pairs]
        rows = sum(len(part) for part in parts)
        noise = fit_noise(parts, 1e-12)
        total += 2.0 * rows * float(np.log(noise.scale / problem.weights[index]))
        power += noise.rms**2
    return total, float(np.sqrt(power))


def _fitted(plant: Plant, train: Sequence[Recording]) -> tuple[Problem, Point, list[tuple[Array, Array]]]:
    """Fit the nominal plant from where it is given."""
    engine = simulator(plant, train[0].hold)
    parts: list[Sequence[Experiment]] = [experiments(plant, recording, NONE) for recording in train]
    problem = make_problem(plant, engine, parts)
    constants = constants_of(plant)
    starts = [
        best_start(made, engine, constants, rest_start(plant, recording), problem.weights)
        for made, recording in zip(problem.experiments, train, strict=True)
    ]
    point, _ = solve(problem, Point(constants, np.stack(starts)), _STEPS)
    return problem, point, list(weighted(problem, point))
