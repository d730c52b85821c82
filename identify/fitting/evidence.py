"""What a plant, its recordings and a fit say together: the evidence that every check looks at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.experiment import Experiment, conditioned, experiments, misfit
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.fitting.least_squares import joined, triangle, triangle_of
from firmloop.identify.fitting.own_values import own_start, steps_apart, usual_start
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import Conditioning
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import course_of, measured, simulator

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """`given` is the plant as the project has it, `fit` what became of it; None before a fit.

    One is equal to itself alone, so that a check that others ask too keeps what it has found in it.
    """

    given: Plant
    recordings: tuple[Recording, ...]
    conditioning: Conditioning
    fit: Fit | None


@dataclass(frozen=True, slots=True)
class Remainder:
    """What a fit leaves of one recording: residuals (q, r) at `time` (q,), and the slopes (q, r, k) it was led by.

    `slopes` are those of the free parameters; `own` (q r, m), orthonormal, what the initial states can do.
    """

    source: str
    time: Array
    residual: Array
    slopes: Array
    own: Array


def sources_of(recordings: Sequence[Recording]) -> str:
    """Return the files of recordings, for a sentence."""
    return ", ".join(dict.fromkeys(recording.source for recording in recordings))


def run_as_given(plant: Plant, recording: Recording) -> Array | None:
    """Return the outputs (n, r) of the plant as given, from rest; None without values, or where it grows and grows."""
    constants = np.array([parameter.value for parameter in plant.parameters])
    return None if np.any(np.isnan(constants)) else _run_from(plant, recording, own_start(plant, recording, constants))


def runs_as_given(evidence: Evidence) -> list[Array] | None:
    """Return the outputs (n, r) of the plant as given for each recording; None as of `run_as_given`.

    A step that begins with its recording is run from where its readings begin: states that fit best would answer it.
    """
    plant = evidence.given
    if any(np.isnan(parameter.value) for parameter in plant.parameters):
        return None
    runs = []
    for recording, step in zip(evidence.recordings, steps_apart(plant, evidence.recordings), strict=True):
        run = _run_from(plant, recording, usual_start(plant, recording)) if step else run_as_given(plant, recording)
        if run is None:
            return None
        runs.append(run)
    return runs


def _run_from(plant: Plant, recording: Recording, start: Array) -> Array | None:
    constants = np.array([parameter.value for parameter in plant.parameters])
    outputs = simulator(plant, recording.hold).run(course_of(plant, recording), constants, start)
    return outputs if np.all(np.isfinite(outputs)) else None


def alike(real: Array, model: Array) -> tuple[float, float]:
    """Return the correlation of two signals (n,), and how many times as large the real one is where they agree."""
    one, other = real - np.mean(real), model - np.mean(model)
    sizes = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if min(sizes) == 0.0:
        return 0.0, 1.0
    shared = float(one @ other)
    return shared / (sizes[0] * sizes[1]), abs(shared) / sizes[1] ** 2


def compared(evidence: Evidence, recording: Recording, outputs: Array) -> list[tuple[Array, Array]]:
    """Return what to compare of each output, measured and simulated: a position by how it moves, the rest as it is."""
    pairs = []
    blocks = max(len(recording.time) // _PIECES, 1)
    real = measured(evidence.given, recording)
    for k, signal in enumerate(evidence.given.outputs):
        one, other = real[:, k], outputs[:, k]
        if signal.name.split("_")[0] == "position":
            one, other = one[blocks:] - one[:-blocks], other[blocks:] - other[:-blocks]
        pairs.append((one, other))
    return pairs


def unexplained(evidence: Evidence, recording: Recording) -> list[float] | None:
    """Return the share of each output's variance that is not explained, by a scale of the plant as given.

    None where the plant cannot be run as it is given.
    """
    run = run_as_given(evidence.given, recording)
    if run is None:
        return None
    fits = [alike(*pair)[0] for pair in compared(evidence, recording, run)]
    return [1.0 - max(fit, 0.0) ** 2 for fit in fits]


_PIECES = 100  # of a recording, over which a position is seen to move
_ROWS = 16_384  # that are put side by side at a time


def remainders(evidence: Evidence) -> tuple[Remainder, ...]:
    """Return what the fit leaves of every train recording."""
    fit = evidence.fit
    assert fit is not None
    plant = fit.plant
    engine = simulator(plant, evidence.recordings[0].hold)
    constants = np.array([parameter.value for parameter in plant.parameters])
    free = [index for index, parameter in enumerate(plant.parameters) if parameter.name in fit.free]
    found = []
    for recording, score in zip(evidence.recordings, fit.train, strict=True):
        parts = [replace(made, lags=score.lags) for made in experiments(plant, recording, evidence.conditioning)]
        each = [misfit(made, engine, constants, start, free) for made, start in zip(parts, score.starts, strict=True)]
        residual = joined([one for one, _ in each])
        states = [slope[..., len(free) :] for _, slope in each]
        own = _block_diagonal([each.reshape(math.prod(each.shape[:-1]), len(plant.states)) for each in states])
        slopes = np.concatenate([slope[..., : len(free)] for _, slope in each])  # not held with those of the states
        found.append(Remainder(score.source, joined([_times(made) for made in parts]), residual, slopes, own))
    return tuple(found)


def _times(made: Experiment) -> Array:
    moments = made.course.time[made.course.first : made.course.end]
    rows = len(conditioned(made, np.zeros((len(moments), len(made.names)))))
    return moments if rows == len(moments) else np.linspace(moments[0], moments[-1], rows)


def _block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return an orthonormal basis of what the initial states of all windows can do."""
    rows = sum(len(block) for block in blocks)
    spans, at = [], 0
    for block in blocks:
        small = triangle(block)
        sizes = np.linalg.norm(small, axis=0)
        sizes[sizes == 0.0] = 1.0
        _, weights, turned = np.linalg.svd(small / sizes)
        seen = weights > 1e-9 * max(float(weights.max(initial=0.0)), 1e-300)
        kept = block @ (turned[seen].T / weights[seen] / sizes[:, None])
        if len(blocks) == 1:
            return np.asarray(kept)
        whole = np.zeros((rows, kept.shape[1]))
        whole[at : at + len(block)] = kept
        spans.append(whole)
        at += len(block)
    return np.concatenate(spans, axis=1)


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a column explains of what is left, `share`, and how often it is in there, `size`.

    The parameters would follow by `taken` (k,).
    """

    share: float
    size: float
    taken: Array


def explained(parts: Sequence[Remainder], weights: Array, columns: Sequence[Array]) -> Explanation:
    """Look for a column (q, r) of each recording in what is left.

    Only what the parameters and the initial states cannot do as well counts. `weights` (r,) are 1 / noise.
    """
    scales = [np.tile(weights, len(part.residual)) for part in parts]
    small = triangle(
        np.concatenate([_without_own(*each) for each in zip(parts, columns, scales, strict=True)])
    )  # [slopes, residual, column]
    slopes, residual, column = small[:, :-2], small[:, -2], small[:, -1]
    sizes = np.linalg.norm(slopes, axis=0)
    sizes[sizes == 0.0] = 1.0
    basis, strengths, turned = np.linalg.svd(slopes / sizes, full_matrices=False)
    kept = strengths > 1e-9
    span, back = basis[:, kept], turned[kept].T / strengths[kept] / sizes[:, None]
    bare, rest = column - span @ (span.T @ column), residual - span @ (span.T @ residual)
    power, size = float(rest @ rest), float(bare @ bare)
    shared = float(bare @ rest) / size if size > 1e-12 * float(column @ column) else 0.0
    taken = back @ (span.T @ (residual - shared * column))
    return Explanation(shared**2 * size / power if power > 0.0 else 0.0, shared, taken)


def left_after(found: Explanation, parts: Sequence[Remainder], weights: Array, columns: Sequence[Array]) -> list[Array]:
    """Return what is left (q, r) of each recording, in units of the noise, once the columns explain their share."""
    rest = []
    for part, column in zip(parts, columns, strict=True):
        scale = np.tile(weights, len(part.residual))
        own, _ = np.linalg.qr(part.own * scale[:, None])
        slopes = part.slopes.reshape(len(scale), -1)
        flat = scale * (part.residual.ravel() - found.size * column.ravel() - slopes @ found.taken)
        rest.append((flat - own @ (own.T @ flat)).reshape(part.residual.shape))
    return rest


def _without_own(part: Remainder, column: Array, scale: Array) -> Array:
    """Return the triangle of [slopes, residual, column] in units of the noise, without what the initial states can."""
    rows, own = len(scale), part.own.shape[1]
    tall = (part.own, part.slopes.reshape(rows, -1), part.residual.reshape(rows, 1), column.reshape(rows, 1))
    blocks = (
        np.concatenate([each[first : first + _ROWS] for each in tall], axis=1) * scale[first : first + _ROWS, None]
        for first in range(0, rows, _ROWS)
    )
    return triangle_of(blocks)[own:, own:]
