"""A Rival: one explanation that was fitted to the end, and what makes one better than another."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.descent import residual_of
from firmloop.diagnose.hypothesis import Cause, Point, Scene, entered, outputs_of
from firmloop.diagnose.policy import ON_BOUND
from firmloop.diagnose.refit import Fitted, evidence, fit, fit_starts, noises_of
from firmloop.identify.fitting.noise import Noise, colored, memory
from firmloop.identify.plants.effects import effects, find_effect

Array = NDArray[np.float64]

TIE = 10.0  # explanations closer than this in BIC are not told apart
RICHER = 25.0  # what a richer effect must win over the simpler one that it contains
MINOR = 0.015  # of what the others explain: less may be the trace of how a model simplifies them
IMPOSSIBLE = 1e9  # the score of what cannot be
_WIDER = 1.1  # ratio of residual rms from which an explanation is none
_SHARPER = 0.75  # ratio of innovation rms, from which an explanation is one however its simulations stray
_TOLD = 0.05  # of what a further effect brings on all recordings, that it has to bring on train
_FEW_PERIODS = 4.0  # in the whole way, below which a wave is as slow as a disturbance
_STRANGE = 2.0  # such a ratio of unseen residuals over white noise, from which an explanation does not hold there
_CLOSER = 0.7, 0.85  # ratios of residual rms, on train and on test, from which an effect is no trace of others
HELD = 0.05  # of what the nominal plant misses of unseen recordings: what leaves no more of that does hold there
_ABSURD = 1e3  # ratio of costs from which initial states are none
_FAINT = 5e-7  # of what an output moves, rms: what simulations by other steps differ by
_CHANCE = 2.0  # deviations of an rms, by which it may be larger where a few slow swings are all it is made of


@dataclass(frozen=True, slots=True)
class Rival:
    """One explanation with the noise it leaves."""

    fitted: Fitted
    noises: tuple[Noise, ...]
    score: float  # BIC on train, and -2 log likelihood on test


def rated(scene: Scene, fitted: Fitted) -> Rival:
    """Score by each output's own innovations on train and, with that noise, on test.

    Where an effect has values that are not its own, that is no explanation.
    """
    noises = noises_of(scene, fitted.residuals)
    if not believable(fitted):
        return Rival(fitted, noises, IMPOSSIBLE)
    return Rival(fitted, noises, evidence(fitted, noises) + unseen(scene, fitted, noises))


def believable(fitted: Fitted) -> bool:
    """Tell whether every effect has values that are its own, none on a bound: that one only stands for another."""
    return not any(on_bound(fitted, cause) for cause in fitted.causes) and all(
        cause.effect.believable is None
        or cause.effect.believable([fitted.point.values[key] for key in cause.keys], cause.scales)
        for cause in fitted.causes
    )


def on_bound(fitted: Fitted, cause: Cause) -> bool:
    """Tell whether a value of an effect ended where its range does."""
    for key, each in zip(cause.keys, cause.parameters, strict=True):
        value = fitted.point.values[key]
        if value <= each.low or (np.isfinite(each.high) and value > each.high - ON_BOUND * abs(each.high)):
            return True
    return False


def unseen(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> float:
    """Return -2 log likelihood of the test recordings but for a constant; only initial states and noise are fitted.

    The noise is estimated anew, as on train: where a plant sums up disturbances, the noise of one recording is too
    sharp a model for another, and the better an explanation the sharper.
    """
    if not scene.test:
        return 0.0
    residuals = unseen_residuals(scene, fitted, noises)
    if any(np.any(np.isnan(residual)) for residual in residuals):
        return IMPOSSIBLE
    return unlikely(scene, residuals)


def unlikely(scene: Scene, residuals: Sequence[Array]) -> float:
    """Return -2 log likelihood of residuals (n, r) with their own noise, but for a constant; 0 of none."""
    rows = sum(len(residual) for residual in residuals)
    return sum(noise.unlikely(rows) for noise in noises_of(scene, residuals)) if residuals else 0.0


def unseen_residuals(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> tuple[Array, ...]:
    """Return measured - simulated (n, r) of every test recording."""
    return elsewhere(scene, fitted, noises)[1].residuals


def elsewhere(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> tuple[Scene, Fitted]:
    """Return the scene of the test recordings, and an explanation there, only its initial states fitted."""
    point = fit_starts(scene, scene.test, fitted.point.values, noises)
    residuals = tuple(residual_of(scene, recording, point, k) for k, recording in enumerate(scene.test))
    return replace(scene, train=scene.test, test=()), replace(fitted, point=point, residuals=residuals)


def memories(residuals: Sequence[Array]) -> Array:
    """Return how many rows of each output's residuals (n, r) count as one sample (r,)."""
    return np.array([memory([part[:, index] for part in residuals]) for index in range(residuals[0].shape[1])])


def by_luck(residuals: Sequence[Array]) -> Array:
    """Return the factor (r,) by which the rms of each output's residuals may be larger by chance.

    That of n independent samples is known to 1 / sqrt(2 n) of itself. NaN after a divergence.
    """
    rows = sum(map(len, residuals))
    return np.asarray(1.0 + _CHANCE * np.sqrt(0.5 * memories(residuals) / rows))


def larger(rival: Rival, base: Rival) -> bool:
    """Tell whether an explanation leaves more than there was: whiter, but no better a prediction of any output."""
    pairs = list(zip(rival.noises, base.noises, strict=True))
    if any(mine.scale <= _SHARPER * theirs.scale or mine.rms <= theirs.rms for mine, theirs in pairs):
        return False
    lucky = by_luck(rival.fitted.residuals)
    return any(mine.rms > max(_WIDER, luck) * theirs.rms for (mine, theirs), luck in zip(pairs, lucky, strict=True))


def farther(rival: Rival, base: Rival) -> bool:
    """Tell whether simulations of some output are farther off than there, however well innovations foresee each row."""
    return any(mine.rms > _WIDER * theirs.rms for mine, theirs in zip(rival.noises, base.noises, strict=True))


def tells(rival: Rival, base: Rival) -> bool:
    """Tell whether an explanation is better on train alone, where it was fitted: unseen recordings only confirm.

    Beside other effects by a share of the whole gain at least: where those are chaotic, any change helps somewhere.
    """
    gain = evidence(base.fitted, base.noises) - evidence(rival.fitted, rival.noises)
    return gain > (_TOLD * (base.score - rival.score) if base.fitted.causes else 0.0)


def faint(scene: Scene, rival: Rival, base: Rival) -> bool:
    """Tell whether all that a rival changes is so little of what each output moves that rounding may be the cause."""
    measured = np.concatenate([outputs_of(scene, recording) for recording in scene.train])
    pairs = zip(rival.fitted.residuals, base.fitted.residuals, strict=True)
    changed = rms_of([mine - theirs for mine, theirs in pairs])
    return bool(np.all(changed < _FAINT * np.ptp(measured, axis=0)))


def creeps(cause: Cause, values: Mapping[str, float]) -> bool:
    """Tell whether an effect may look like a slow disturbance; a wave that hardly repeats in the whole way does."""
    periods = {".periods_per_rev": cause.scales.travel / (2.0 * np.pi), ".periods_per_m": cause.scales.travel}
    waves = [values[key] * way for ending, way in periods.items() for key in cause.keys if key.endswith(ending)]
    return cause.effect.slow or min(waves, default=np.inf) < _FEW_PERIODS


def rms_of(residuals: Sequence[Array]) -> Array:
    """Return the rms (r,) of residuals (n, r) of several recordings, output by output."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0)))


def relative(residuals: Sequence[Array], sizes: Sequence[float]) -> float:
    """Return the rms of residuals (n, r) over the sizes (r,) of the noise, over all outputs."""
    return float(np.sqrt(np.mean((np.concatenate(residuals) / np.asarray(sizes)) ** 2)))


def contradicted(scene: Scene, rival: Rival, nominal: Rival) -> bool:
    """Tell whether unseen recordings are missed by far more than the white noise that train leaves.

    Not where nearly all that the nominal plant misses of them is explained.
    """
    if not scene.test or colored(rival.noises):
        return False
    sizes = [noise.rms for noise in rival.noises]
    after, refit = (relative(unseen_residuals(scene, each.fitted, rival.noises), sizes) for each in (rival, nominal))
    return not (after < _STRANGE or after < HELD * refit)


def closer(scene: Scene, rival: Rival, base: Rival) -> bool:
    """Tell whether simulations come far closer to some output, the unseen ones too: that is no trace."""
    train = [one.rms / other.rms for one, other in zip(rival.noises, base.noises, strict=True)]
    if not min(train) < _CLOSER[0] or not scene.test:
        return False
    powers = [
        np.mean(np.concatenate(unseen_residuals(scene, each.fitted, each.noises)) ** 2, axis=0)
        for each in (rival, base)
    ]
    return bool(np.any((np.array(train) < _CLOSER[0]) & (powers[0] < _CLOSER[1] ** 2 * powers[1])))


def joined(base: Fitted, cause: Cause) -> tuple[tuple[Cause, ...], Mapping[str, float]]:
    """Return the causes of a hypothesis with one more and the values they keep; a simpler one gives way."""
    kept, point = without(base, *(each for each in base.causes if each.effect.name in cause.effect.contains))
    return (*kept, cause), point.values


def extended(base: Fitted, cause: Cause, start: Mapping[str, float]) -> tuple[tuple[Cause, ...], Point]:
    """Add a cause at its start to a hypothesis; a simpler one that it contains gives way."""
    causes, values = joined(base, cause)
    return causes, Point(entered(values, cause, start), base.point.starts)


def without(base: Fitted, *gone: Cause) -> tuple[tuple[Cause, ...], Point]:
    """Take causes out of a hypothesis; an inertia that one had taken goes back to the nominal one."""
    lost = {key for cause in gone for key in cause.keys}
    values = {key: value for key, value in base.point.values.items() if key not in lost}
    for load, held in (cause.taken for cause in gone if cause.taken is not None):
        values[held] += base.point.values[load]
    return tuple(cause for cause in base.causes if cause not in gone), Point(values, base.point.starts)


def relieved(scene: Scene, base: Fitted, gone: Cause, noises: Sequence[Noise]) -> tuple[tuple[Cause, ...], Point]:
    """Take a cause out; where initial states alone do what it did, as what an offset does, they have moved there.

    So they have where it had hidden what they are: a current of a million amperes behind iron that saturates.
    """
    causes, point = without(base, gone)
    taken = fit_starts(scene, scene.train, point.values, noises)
    now, then = (
        fit(scene, scene.train, *each, noises, 0).cost for each in ((base.causes, base.point), (causes, taken))
    )
    if then - now < RICHER or not fit(scene, scene.train, causes, point, noises, 0).cost < _ABSURD * then:
        return causes, taken
    return causes, point


def containing(name: str) -> tuple[str, ...]:
    """Return the effects that have the one called `name` as a special case."""
    return tuple(rich.name for rich in effects().values() if name in rich.contains)


def related(name: str) -> tuple[str, ...]:
    """Return what the effect called `name` has as a special case, and what has it as one."""
    return (*find_effect(name).contains, *containing(name))


def contain(some: Collection[str], others: Collection[str]) -> bool:
    """Tell whether one of the first effects has one of the others as a special case."""
    return any(other in find_effect(name).contains for name in some for other in others)


def simplest(rivals: Sequence[Rival], without: float, least: float = RICHER) -> Rival:
    """Return the best; a simpler one that it contains wins where the richer one gains less than `least` beside it.

    `without` is the score without either.
    """
    chosen = rivals[0]
    for other in rivals[1:]:
        last, rest = chosen.fitted.causes[-1].effect, other.fitted.causes[-1].effect
        if rest.name in last.contains and not richer(chosen, other, without - other.score, least):
            chosen = other
    return chosen


def richer(rival: Rival, simpler: Rival, gain: float, least: float = RICHER) -> bool:
    """Tell whether an effect wins enough over the simpler one that it contains, which had won `gain`.

    Also on train alone: its further parameters have to tell there, where they were fitted.
    """
    return tells(rival, simpler) and simpler.score - rival.score >= max(least, MINOR * gain)
