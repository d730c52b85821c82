"""Locate a mismatch: what a smoother is to follow, and the spans where the nominal plant fits worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate
from firmloop.diagnose.policy import FEW_ROWS, MOST_OF_IT, SHORTEST_SPAN_S, WORST_SPANS
from firmloop.diagnose.search.found import Search
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.plants.per_recording import without_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


def nominal_plant(search: Search, candidate: Candidate) -> Plant:
    """Return the plant without effects, with the nominal parameters of an explanation."""
    return without_varying(search.problem.plant.valued(candidate.fitted.point.values))


def as_others(search: Search, recording: Recording, values: Mapping[str, float], start: Array) -> Recording:
    """Return the recording without what its own load, zero and the like, which its initial state holds, do to it."""
    plant, engine = search.problem.plant, search.problem.engine
    if not plant.varying:
        return recording
    common = start.copy()
    common[[one.state for one in plant.varying]] = 0.0
    own = np.nan_to_num(engine.simulate(recording, values, start) - engine.simulate(recording, values, common))
    outputs = {signal.name: recording.columns[signal.name] - own[:, k] for k, signal in enumerate(plant.outputs)}
    return replace(recording, columns={**recording.columns, **outputs})


def worst_spans(search: Search, noises: Sequence[Noise]) -> tuple[str, tuple[tuple[float, float], ...]]:
    """Return the output that fits worst, and the spans (s) of the first train recording where, in units of the noise.

    `noises` are of what nothing is missing from, one an output.
    """
    problem, nominal = search.problem, search.nominal
    left = nominal.fitted.residuals[0]
    each = np.column_stack([noise.whiten(left[:, k]) for k, noise in enumerate(noises)])
    for k, noise in enumerate(noises):
        each[: len(noise.coefficients), k] = 0.0  # no past to whiten by
    worst = int(np.argmax(np.sum(each**2, axis=0)))
    time = problem.train[0].time
    step = float(np.median(np.diff(time)))
    width = max(int(SHORTEST_SPAN_S / step), 3)
    power = scipy.ndimage.uniform_filter1d(each[:, worst] ** 2, width)
    spans: list[tuple[float, float]] = []
    open_power = power.copy()
    level = 0.3 * float(np.max(power))
    for _ in range(WORST_SPANS):
        peak = int(np.argmax(open_power))
        if open_power[peak] <= max(level, 0.0):
            break
        low = high = peak
        while low > 0 and open_power[low - 1] > 0.5 * power[peak]:
            low -= 1
        while high + 1 < len(power) and open_power[high + 1] > 0.5 * power[peak]:
            high += 1
        spans.append((float(time[low]), float(time[high])))
        open_power[max(low - width, 0) : high + width] = 0.0
    return problem.plant.outputs[worst].name, tuple(sorted(spans))


def gathered(search: Search, output: str, spans: Sequence[tuple[float, float]]) -> str:
    """Say that few rows, those of the spans, hold most of what the nominal plant misses of an output; blank if not.

    Readings that failed do so, or what happened once; physics comes again.
    """
    column = [signal.name for signal in search.problem.plant.outputs].index(output)
    left = [part[:, column] ** 2 for part in search.nominal.fitted.residuals]
    time, whole = search.problem.train[0].time, float(sum(np.sum(part) for part in left))
    inside = np.any([(time >= low) & (time <= high) for low, high in spans] or [np.zeros(len(time), bool)], axis=0)
    rows, count = int(np.sum(inside)), sum(map(len, left))
    share = float(np.sum(left[0][inside])) / whole if whole > 0.0 else 0.0
    if rows > FEW_ROWS * count or share < MOST_OF_IT:
        return ""
    return (
        f"; {rows} of {count} rows hold {100.0 * share:.0f} % of the squares of all that it misses: look whether these "
        "readings failed, or what happened there once"
    )
