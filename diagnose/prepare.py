"""Make recordings ready to be searched: keep what a search can afford, and find out what the input did between rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diagnose.noise import fit_noise
from identify.clock import evened
from identify.condition import NONE, Conditioning, check_conditioning, condition_input
from identify.experiment import Experiment, best_start, experiments
from identify.forms import form_writer
from identify.hold import FINER, HOLDS
from identify.least_squares import triangle
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


def as_conditioned(
    plant: Plant, recordings: Sequence[Recording], conditioning: Conditioning
) -> tuple[tuple[Recording, ...], tuple[str, ...]]:
    """Do to the recordings what the project asks for and a search can take; return what it does not need, in words.

    An input loses its offset, as in a fit. Windows, smoothing and a coarser grid are ways to fit in noise of which the
    search has a model of its own. What would take a mismatch out of sight, or hide one in a clock, is refused.
    """
    where = "recordings.conditioning"
    inputs = [signal.name for signal in plant.inputs]
    for recording in recordings:
        check_conditioning(
            conditioning, (*inputs, *(signal.name for signal in plant.outputs)), recording.source, recording.time
        )
    offsets = [name for name in conditioning.remove_offset if name not in inputs]
    refused = (
        ("remove_offset", offsets, "an offset of a sensor is one of the effects that are looked for"),
        ("detrend", conditioning.detrend, "a trend is part of what physics does"),
        ("align", conditioning.align, "a late or skewed clock is one of the effects that are looked for"),
        ("line_Hz", conditioning.line_Hz, "the notch would take a part of the motion out"),
    )
    for key, value, why in refused:
        if value:
            shown = list(value) if isinstance(value, list | tuple) else value
            raise IdentifyError(
                f"{where}.{key} = {shown}: diagnose compares the outputs as they were recorded, because {why}; "
                "remove it, or record without the disturbance"
            )
    unused = [key for key in ("window_s", "savgol_window", "resample_s") if getattr(conditioning, key)]
    made = [
        replace(
            each,
            columns={
                name: condition_input(conditioning, name, values) if name in inputs else values
                for name, values in each.columns.items()
            },
        )
        for each in recordings
    ]
    notes = [f"{where}.{', '.join(unused)} not used: the search has a noise model of its own"] if unused else []
    return tuple(made), tuple(notes)


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
        if not _LIKE[0] < _share(plant, train) < _LIKE[1]:
            return given
        tried = {hold: _evidence(plant, [replace(each, hold=hold) for each in train]) for hold in HOLDS}
    except IdentifyError:
        return given  # preflight will say it better
    best = min(tried, key=lambda hold: tried[hold][0])
    clear = tried[best][0] < tried[given][0] - _WORTH and tried[best][1] < _SMALLER * tried[given][1]
    return best if clear else given


def _share(plant: Plant, train: Sequence[Recording]) -> float:
    """Return how much of what a straight-line hold would change stands in the residual of the fitted nominal plant."""
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
        return 0.0
    norms = np.linalg.norm(tall, axis=0)
    small = triangle(np.column_stack([tall[:, norms > 0.0] / norms[norms > 0.0], secant, left]))[-2:, -2:]
    return float(small[0, 1] / small[0, 0]) if small[0, 0] != 0.0 else 0.0


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
