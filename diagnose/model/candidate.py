"""A Candidate: one explanation that was fitted to the end, and what makes one better than another."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import Fitted, evidence, fit, fit_starts, noises_of, past_kinks, strength
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, outputs_of
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import (
    ABSURD_COST,
    CLOSER_RMS,
    EVEN_CHANCE,
    FAINT_SHARE,
    IMPOSSIBLE,
    MINOR_SHARE,
    ON_BOUND,
    REFITS,
    RICHER_PRICE,
    RMS_BY_CHANCE,
    SAME_RMS,
    SLOW_WAVE_PERIODS,
    STEPS_OF_A_FIT,
    WIDER_RMS,
)
from firmloop.identify.fitting.noise import Noise, memory, white
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.effects import effects, find_effect

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One explanation with the noise it leaves.

    `likelier` is a fit of the same effects that is likelier, but simulates farther off.
    """

    fitted: Fitted
    noises: tuple[Noise, ...]
    score: float  # BIC
    likelier: Candidate | None = None

    @property
    def likeliest(self) -> Candidate:
        """The likeliest fit of the same effects that is known, however far off it simulates."""
        return self.likelier or self


def rated(problem: Problem, fitted: Fitted) -> Candidate:
    """Score by each output's own innovations, without what the newest has left nothing of, or nothing usual.

    Where the newest effect has values that are not its own, that is no explanation.
    """
    if gone := [term for term in fitted.terms[:-1] if _vanished(fitted, term)]:
        fitted = fit(problem, problem.train, *without(fitted, *gone), fitted.noises, 0)
    noises = noises_of(problem, fitted.residuals)
    if believable(fitted):
        return Candidate(fitted, noises, evidence(fitted, noises))
    if not _own(fitted, fitted.terms[-1]):
        return Candidate(fitted, noises, IMPOSSIBLE)
    strange = [term for term in fitted.terms if not _own(fitted, term)]
    return rated(problem, fit(problem, problem.train, *without(fitted, *strange), noises, STEPS_OF_A_FIT))


def believable(fitted: Fitted) -> bool:
    """Tell whether every effect has values that are its own, none on a bound: that one only stands for another."""
    return all(_own(fitted, term) for term in fitted.terms)


def likely(fitted: Fitted) -> bool:
    """Tell whether every effect is believable and distinct, and by its own interval likelier something than nothing."""
    sure = believable(fitted) and all(strength(fitted, term) > EVEN_CHANCE for term in fitted.terms)
    return sure and distinct(fitted)


def distinct(fitted: Fitted) -> bool:
    """Tell whether no effect may stand for what the plant makes of a change of its input."""
    asked = [(term.effect.distinct, term) for term in fitted.terms]
    return all(ask is None or ask([fitted.point.values[key] for key in term.keys], term.scales) for ask, term in asked)


def _own(fitted: Fitted, term: LibraryTerm) -> bool:
    values = [fitted.point.values[key] for key in term.keys]
    return not on_bound(fitted, term) and (
        term.effect.believable is None or term.effect.believable(values, term.scales)
    )


def _vanished(fitted: Fitted, term: LibraryTerm) -> bool:
    """Tell whether an effect has ended as large as nothing."""
    sizes = zip(term.keys[:1], term.parameters[:1], strict=True)
    return any(fitted.point.values[key] == each.low == each.neutral for key, each in sizes)


def on_bound(fitted: Fitted, term: LibraryTerm) -> bool:
    """Tell whether a value of an effect ended where its range does, unless that is what it is where none is given.

    What may be left out of a project is a detail, as the share that runs on: its range ends where nature's does. And a
    limit at which readings rest to the last digit is there, whatever its range.
    """
    for key, each in zip(term.keys, term.parameters, strict=True):
        value = fitted.point.values[key]
        if term.effect.limits and each.low > 0.0:
            continue
        if value <= each.low != each.default:
            return True
        if each.default is None and np.isfinite(each.high) and value > each.high - ON_BOUND * abs(each.high):
            return True
    return False


def unlikely(problem: Problem, residuals: Sequence[Array]) -> float:
    """Return -2 log likelihood of residuals (n, r) with their own noise, but for a constant; 0 of none."""
    rows = sum(len(residual) for residual in residuals)
    return sum(noise.unlikely(rows) for noise in noises_of(problem, residuals)) if residuals else 0.0


def unseen_residuals(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> tuple[Array, ...]:
    """Return measured - simulated (n, r) of every test recording, only their initial states fitted."""
    point = fit_starts(problem, problem.test, fitted.point.values, noises)
    return tuple(residual_of(problem, recording, point, k) for k, recording in enumerate(problem.test))


def memories(residuals: Sequence[Array]) -> Array:
    """Return how many rows of each output's residuals (n, r) count as one sample (r,)."""
    return np.array([memory([part[:, index] for part in residuals]) for index in range(residuals[0].shape[1])])


def by_luck(residuals: Sequence[Array]) -> Array:
    """Return the factor (r,) by which the rms of each output's residuals may be larger by chance.

    That of n independent samples is known to 1 / sqrt(2 n) of itself. NaN after a divergence.
    """
    rows = sum(map(len, residuals))
    return np.asarray(1.0 + RMS_BY_CHANCE * np.sqrt(0.5 * memories(residuals) / rows))


def beyond_chance(mine: Sequence[Array], theirs: Sequence[Array]) -> bool:
    """Tell whether one explanation leaves less of some output than another, by more than chance.

    Both leave residuals (n, r) of the same rows; the mean of what their squares differ by is judged by how far that
    mean may be off (Diebold and Mariano 1995).
    """
    gains = [other**2 - one**2 for one, other in zip(mine, theirs, strict=True)]
    every = np.concatenate(gains)
    deviations = np.std(every, axis=0) * np.sqrt(memories(gains) / len(every))
    return bool(np.any(np.mean(every, axis=0) > NORMAL_95 * deviations))


def larger(candidate: Candidate, base: Candidate) -> bool:
    """Tell whether an explanation leaves more than there was: whiter, but no better a prediction of any output.

    Where a misfit counts, scores tell that.
    """
    pairs = zip(candidate.noises, base.noises, strict=True)
    worse = farther(candidate, base) and not any(mine.rms <= theirs.rms for mine, theirs in pairs)
    return worse and not counts_misfit(candidate)


def by_simulation_error(problem: Problem, begin: Fitted, beside: Array | None = None) -> Fitted:
    """Fit the same terms by plain simulation error, each output weighed by 1 / its own residual rms.

    Where sizes `beside` (r,) are given, by 1 / those, and all by one factor.
    """
    fitted = begin
    for _ in range(REFITS):
        left = np.maximum(np.maximum(rms_of(fitted.residuals), problem.floors), 1e-30)
        if beside is not None:
            left = beside * np.sqrt(np.mean((left / beside) ** 2))
        sizes = [white(float(rms)) for rms in left]
        fitted = fit(problem, problem.train, fitted.terms, fitted.point, sizes, STEPS_OF_A_FIT)
    return past_kinks(problem, fitted)


def clearly_nearer(one: Fitted, other: Fitted) -> bool:
    """Tell whether simulations of one fit come nearer to some output than by chance, and to none less near."""
    ours, theirs = (np.nan_to_num(rms_of(each.residuals), nan=np.inf) for each in (one, other))
    lucky = np.maximum(by_luck(one.residuals), SAME_RMS)
    return bool(np.all(ours <= SAME_RMS * theirs) and np.any(lucky * ours < theirs))


def farther(candidate: Candidate, base: Candidate) -> bool:
    """Tell whether simulations of some output are farther off than there, however well innovations foresee each row."""
    return any(mine.rms > WIDER_RMS * theirs.rms for mine, theirs in zip(candidate.noises, base.noises, strict=True))


def faint(problem: Problem, candidate: Candidate, base: Candidate) -> bool:
    """Tell whether all that a candidate changes is so little of what each output moves that it may be rounding."""
    measured = np.concatenate([outputs_of(problem, recording) for recording in problem.train])
    pairs = zip(candidate.fitted.residuals, base.fitted.residuals, strict=True)
    changed = rms_of([mine - theirs for mine, theirs in pairs])
    return bool(np.all(changed < FAINT_SHARE * np.ptp(measured, axis=0)))


def creeps(term: LibraryTerm, values: Mapping[str, float]) -> bool:
    """Tell whether an effect may look like a slow disturbance; a wave that hardly repeats in the whole way does."""
    periods = {".periods_per_rev": term.scales.travel / (2.0 * np.pi), ".periods_per_m": term.scales.travel}
    waves = [values[key] * way for ending, way in periods.items() for key in term.keys if key.endswith(ending)]
    return term.effect.slow or min(waves, default=np.inf) < SLOW_WAVE_PERIODS


def rms_of(residuals: Sequence[Array]) -> Array:
    """Return the rms (r,) of residuals (n, r) of several recordings, output by output."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0)))


def residual_sizes(residuals: Sequence[Array]) -> tuple[float, ...]:
    """Return the rms of every output's residuals as a noise model takes it: more than zero."""
    return tuple(max(float(size), 1e-30) for size in rms_of(residuals))


def relative(residuals: Sequence[Array], sizes: Sequence[float]) -> float:
    """Return the rms of residuals (n, r) over the sizes (r,) of the noise, over all outputs."""
    return float(np.sqrt(np.mean((np.concatenate(residuals) / np.asarray(sizes)) ** 2)))


def closer(candidate: Candidate, base: Candidate) -> bool:
    """Tell whether simulations come far closer to some output, and by more than by chance: that is no trace."""
    lucky = np.maximum(by_luck(candidate.fitted.residuals), 1.0 / CLOSER_RMS)
    pairs = zip(lucky, candidate.noises, base.noises, strict=True)
    return any(luck * mine.rms < theirs.rms for luck, mine, theirs in pairs)


def joined(base: Fitted, term: LibraryTerm) -> tuple[tuple[LibraryTerm, ...], Mapping[str, float]]:
    """Return the terms of a hypothesis with one more and the values they keep; a simpler one gives way."""
    kept, point = without(base, *(each for each in base.terms if each.effect.name in term.effect.contains))
    return (*kept, term), point.values


def extended(base: Fitted, term: LibraryTerm, start: Mapping[str, float]) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Add a term at its start to a hypothesis; a simpler one that it contains gives way."""
    terms, values = joined(base, term)
    return terms, Point(entered(values, term, start), base.point.starts)


def without(base: Fitted, *gone: LibraryTerm) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Take terms out of a hypothesis; an inertia that one had taken goes back to the nominal one."""
    lost = {key for term in gone for key in term.keys}
    values = {key: value for key, value in base.point.values.items() if key not in lost}
    for load, held in (term.taken for term in gone if term.taken is not None):
        values[held] += base.point.values[load]
    return tuple(term for term in base.terms if term not in gone), Point(values, base.point.starts)


def relieved(
    problem: Problem, base: Fitted, gone: LibraryTerm, noises: Sequence[Noise]
) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Take a term out; where initial states alone do what it did, as what an offset does, they have moved there.

    So they have where it had hidden what they are: a current of a million amperes behind iron that saturates.
    """
    terms, point = without(base, gone)
    taken = fit_starts(problem, problem.train, point.values, noises)
    plain = SumOfSquares(problem, problem.train, (), noises, np.zeros((0, 1)))
    now, then, left = (plain.at(each).cost for each in (base.point, taken, point))
    if then - now < RICHER_PRICE or not left < ABSURD_COST * then:
        return terms, taken
    return terms, point


def containing(name: str) -> tuple[str, ...]:
    """Return the effects that have the one called `name` as a special case."""
    return tuple(rich.name for rich in effects().values() if name in rich.contains)


def related(name: str) -> tuple[str, ...]:
    """Return what the effect called `name` has as a special case, and what has it as one."""
    return (*find_effect(name).contains, *containing(name))


def contain(some: Collection[str], others: Collection[str]) -> bool:
    """Tell whether one of the first effects has one of the others as a special case."""
    return any(other in find_effect(name).contains for name in some for other in others)


def worth_their_price(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Drop each explanation that wins less over another, which it has as a special case, than a richer effect must.

    Only where it is a misfit that counts, as a few samples: every richer effect is then as good as the simple one.
    """
    return [
        each
        for each in candidates
        if not counts_misfit(each)
        or not any(_has_as_case(each, other) and not richer(each, other, 0.0) for other in candidates)
    ]


def counts_misfit(candidate: Candidate) -> bool:
    """Tell whether what an explanation leaves counts as a few samples of a misfit: scores are simulation error."""
    return any(noise.samples < 1.0 for noise in candidate.noises)


def _has_as_case(one: Candidate, other: Candidate) -> bool:
    mine, theirs = set(one.fitted.terms), set(other.fitted.terms)
    gone, come = ([each.effect.name for each in terms] for terms in (mine - theirs, theirs - mine))
    return len(gone) == len(come) == 1 and contain(gone, come)


def simplest(candidates: Sequence[Candidate], without: float, least: float = RICHER_PRICE) -> Candidate:
    """Return the best; a simpler one that it contains wins where the richer one gains less than `least` beside it.

    `without` is the score without either.
    """
    chosen = candidates[0]
    for other in candidates[1:]:
        last, rest = chosen.fitted.terms[-1].effect, other.fitted.terms[-1].effect
        if rest.name in last.contains and not richer(chosen, other, without - other.score, least):
            chosen = other
    return chosen


def richer(candidate: Candidate, simpler: Candidate, gain: float, least: float = RICHER_PRICE) -> bool:
    """Tell whether an effect wins enough over the simpler one that it contains, which had won `gain`."""
    return simpler.score - candidate.score >= max(least, MINOR_SHARE * gain)
