"""A residual that is not noise: what the input and the motion still explain of it, the equations lack.

Colour alone is no fault: intervals are widened for it. The residual is regressed on the past input and on functions of
the simulated outputs, and the share explained is held against that of residuals drawn from an autoregression fitted to
them, as it is and made as loud as they are in each octave. (Random phases keep a spectrum too, but end where they
began, and what drifts does not.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.effective_samples import drawn_from, noises_of
from firmloop.identify.fitting.evidence import Evidence, Remainder, explained, left_after, remainders, run_as_given
from firmloop.identify.fitting.least_squares import triangle
from firmloop.identify.fitting.noise import Noise
from firmloop.identify.fitting.residual_tests import independent
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import condition_output
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]
Columns = NDArray[np.float32]

_LAGS = 10  # of the past input, spaced by powers
_SURROGATES = 100
_BEYOND = 4.5  # deviations of the logarithm of what surrogates leave unexplained
_SHARE = 0.15  # of the residual's variance, beyond what surrogates have
_CERTAIN = 24.0  # by which twice the log likelihood rises, as of a drift
_SMALL = 1e-3  # of the output's spread: a residual below it harms nobody
_SEED = 20240229  # any; fixed, so that a check repeats


@lru_cache(maxsize=2)
def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each output of all recordings together, then of each of them; a small share is not worth a word."""
    assert evidence.fit is not None
    plant = evidence.fit.plant
    found = []
    parts = remainders(evidence)
    left, bent = answers(evidence, parts, _SHARE), _bent(evidence, parts)
    for output in plant.outputs:
        worst, where = max((shares[output.name], source) for source, shares in left)
        if output.name in bent:
            found.append(
                f"what {plant.kind} leaves of {output.name} bends with its level: over all recordings "
                f"{100.0 * bent[output.name]:.0f} % of it goes with the square of {output.name}, as where heat is lost "
                "by radiation or convection, or a fluid drags, so that one set of values does not hold at every level; "
                'ask firmloop diagnose what is missing, or write that loss with plant.kind = "ode", which firmloop '
                "explain ode shows"
            )
        elif worst > _SHARE:
            found.append(
                f"what {plant.kind} leaves of {output.name} in {where} is no noise: the input still explains "
                f"{100.0 * worst:.0f} % of it, so that the intervals do not hold; ask firmloop diagnose what is "
                "missing, or choose another plant.kind"
            )
    return tuple(found)


def answers(evidence: Evidence, parts: Sequence[Remainder], least: float = 0.0) -> list[tuple[str, dict[str, float]]]:
    """Return which share of each recording's residuals its input explains beyond chance: source, then by output.

    `parts` are the remainders of the evidence; 0 stands for a share of no more than `least`.
    """
    assert evidence.fit is not None
    found = []
    for part, recording, score in zip(parts, evidence.recordings, evidence.fit.train, strict=True):
        shares = {}
        for k, output in enumerate(evidence.fit.plant.outputs):
            residual, spread = part.residual[:, k], float(np.std(recording.columns[output.name]))
            told = len(residual) == len(recording.time) and np.std(residual) >= _SMALL * spread
            given = features(evidence.fit.plant, recording, score.simulated) if told else None
            shares[output.name] = 0.0 if given is None else explained_share(residual, given, least)
        found.append((score.source, shares))
    return found


def _bent(evidence: Evidence, parts: Sequence[Remainder]) -> dict[str, float]:
    """Return which share of what is left an input would leave that goes with the square of a simulated output.

    By output, where that is worth a word and no chance: few steps of several recordings tell it only together.
    """
    assert evidence.fit is not None
    plant = evidence.fit.plant
    found: dict[str, float] = {}
    pairs = list(zip(evidence.recordings, evidence.fit.train, strict=True))
    if any(len(part.residual) != len(one.time) for part, (one, _) in zip(parts, pairs, strict=True)):
        return {}
    weights = np.array([1.0 / max(evidence.fit.noise[o.name], 1e-300) for o in plant.outputs])
    names = [each.name for each in plant.inputs]
    undriven = {name: [_run(plant, one, name, np.zeros(len(one.time))) for one, _ in pairs] for name in names}
    for k, output in enumerate(plant.outputs):
        if evidence.fit.noise[output.name] < _SMALL * max(np.std(one.columns[output.name]) for one, _ in pairs):
            continue
        for name, turn in product(undriven, _BENDS):
            drives = [turn(score.simulated[:, k]) for _, score in pairs]
            scale = max(_size(one.columns[name]) for one, _ in pairs) / max(map(_size, drives))
            runs = [_run(plant, one, name, scale * drive) for (one, _), drive in zip(pairs, drives, strict=True)]
            columns = [
                _compared(evidence, one, run - rest)
                for (one, _), run, rest in zip(pairs, runs, undriven[name], strict=True)
                if run is not None and rest is not None
            ]
            if len(columns) < len(pairs):
                continue
            bend = explained(parts, weights, columns)
            lefts = left_after(bend, parts, weights, columns)
            rise = -independent([left[:, k] for left in lefts]) * math.log(max(1.0 - bend.share, 1e-300))
            if bend.share > max(_SHARE, found.get(output.name, 0.0)) and rise > _CERTAIN:
                found[output.name] = bend.share
    return found


def _run(plant: Plant, recording: Recording, name: str, drive: Array) -> Array | None:
    """Return the outputs (n, r) of the plant as given, with another input (n,) than was recorded; None of none."""
    return run_as_given(plant, replace(recording, columns={**recording.columns, name: drive}))


def _compared(evidence: Evidence, recording: Recording, moved: Array) -> Array:
    """Return what is compared of a motion (n, r) of the outputs."""
    told = zip(evidence.given.outputs, moved.T, strict=True)
    return np.stack([condition_output(evidence.conditioning, o.name, recording.time, each) for o, each in told], 1)


def features(plant: Plant, recording: Recording, outputs: Array) -> Columns:
    """Return what the inputs alone decide (n, f), each column without its mean, of about size 1.

    Their past; bent functions of the simulated outputs (n, r); and what the plant makes of a bent input. In single
    precision: there are many, each as long as the recording.
    """
    drives = {each.name: recording.columns[each.name] for each in plant.inputs}
    rows = len(outputs)
    lags = np.unique(np.round(np.geomspace(1.0, max(rows / 4.0, 2.0), _LAGS)).astype(int))
    width = len(drives) * (len(lags) + len(_TURNS) * outputs.shape[1]) + 4 * outputs.shape[1]
    found = np.empty((rows, width), np.float32)
    count = 0

    def keep(column: Array) -> None:
        nonlocal count
        centred = column - column.mean()
        found[:, count] = centred / _size(centred)
        count += 1

    for drive, lag in product(drives.values(), lags):
        keep(np.concatenate([np.full(lag, drive[0]), drive[:-lag]]))
    for column in outputs.T:
        keep(column)
        keep(np.abs(column))
        keep(np.tanh(20.0 * column / _size(column)))
        keep(column**3)
    for (name, drive), turn in product(drives.items(), _TURNS):
        run = _run(plant, recording, name, turn(drive))
        for column in run.T if run is not None else ():
            keep(column)
    return found[:, :count]


def _size(values: Array) -> float:
    return float(np.max(np.abs(values))) or 1.0


_BENDS: tuple[Callable[[Array], Array], ...] = (np.square, lambda y: y * np.abs(y))
_TURNS: tuple[Callable[[Array], Array], ...] = (
    lambda u: u * np.abs(u),
    np.abs,
    lambda u: np.tanh(20.0 * u / _size(u)),
)


def answering(residual: Array, given: Columns, noisy: bool = True) -> float:
    """Return which share of a residual (n,) the features (n, f) explain, where that is worth a word; else 0."""
    return explained_share(residual, given, _SHARE, noisy)


def _as_loud(values: Array, noise: Noise) -> Callable[[Array], Array]:
    """Return how to make what is drawn from an autoregression of values (n,) as loud as they are, octave by octave.

    Where it is not: few coefficients do not hold what grows for ever towards slow. From one octave to the next slower
    one by 1/f at most, for what grows faster is no noise of a sensor.
    """
    heard = np.abs(np.fft.rfft(values)) ** 2 / len(values)
    turns = np.exp(-2j * np.pi * np.fft.rfftfreq(len(values)))
    made = (noise.scale / np.abs(np.polyval([*noise.coefficients[::-1], 1.0], turns))) ** 2
    octave = np.frexp(np.arange(len(heard)))[1]
    power, drawn = (np.bincount(octave, each) / np.bincount(octave) for each in (heard, made))
    allowed = drawn.copy()
    for k in range(len(allowed) - 2, -1, -1):
        allowed[k] = max(drawn[k], min(power[k], 2.0 * allowed[k + 1]))
    louder = np.sqrt(allowed / drawn)[octave]
    return lambda each: np.fft.irfft(louder * np.fft.rfft(each), len(values))


def explained_share(residual: Array, given: Columns, least: float, noisy: bool = True) -> float:
    """Return which share of a residual (n,) the features (n, f) explain beyond chance, if it is more than `least`.

    0 where it is not, or chance is enough; chance, which only takes of a share, is asked last: it takes the longest.
    Noise as slow as 1/f is chance only where the residual may be noise at all, `noisy`.
    """
    away = residual - residual.mean()
    power = float(away @ away)
    if power == 0.0:
        return 0.0
    square = triangle(given)
    sizes = np.linalg.norm(square, axis=0)
    sizes[sizes == 0.0] = 1.0
    _, strengths, turned = np.linalg.svd(square / sizes)
    kept = strengths > 1e-6 * strengths.max(initial=1.0)
    span = turned[kept] / strengths[kept, None] / sizes  # of the features, orthonormal

    def explained(values: Array) -> float:
        unit = values / np.linalg.norm(values)
        return float(np.sum((span @ (given.T @ unit.astype(np.float32))) ** 2))

    share = explained(away)
    if share <= least:
        return 0.0
    noises = noises_of([away[:, None]])

    def beyond(turned: Callable[[Array], Array]) -> float:
        random, by_chance = np.random.default_rng(_SEED), np.empty(_SURROGATES)
        for k in range(_SURROGATES):  # one at a time, for each is as long as the recording
            drawn = turned(drawn_from(noises, len(away), random)[:, 0])
            by_chance[k] = explained(drawn - drawn.mean())
        unexplained = np.log(np.maximum(1.0 - by_chance, 1e-12))
        far = (float(np.mean(unexplained)) - np.log(max(1.0 - share, 1e-12))) / max(float(np.std(unexplained)), 1e-12)
        more = share - float(np.mean(by_chance))
        return more if far > _BEYOND and more > least else 0.0

    as_fitted = beyond(lambda drawn: drawn)
    return min(as_fitted, beyond(_as_loud(away, noises[0]))) if as_fitted and noisy else as_fitted


CHECK = Check("structure", look, (), True)
