"""Turn a search into a verdict: named, tied, unknown, or nothing to say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.data.checks import Preflight
from firmloop.diagnose.data.quantization import Direct
from firmloop.diagnose.discrepancy.disturbance import rivals_noise
from firmloop.diagnose.discrepancy.fit import Shape, best_shape, outweighs
from firmloop.diagnose.discrepancy.locate import gathered, worst_spans
from firmloop.diagnose.finding import Alternative, Estimate, Finding, Location, Named, Ratio, Shift, Verdict
from firmloop.diagnose.model.candidate import Candidate, larger, relative, residual_sizes, unseen_residuals, without
from firmloop.diagnose.model.fit import beside_scale, deviations, fit, fit_starts, noises_of, strength
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem, as_written
from firmloop.diagnose.model.own_values import own_of_all
from firmloop.diagnose.model.sandwich_covariance import doubtful
from firmloop.diagnose.model.scale_doubt import interval_of
from firmloop.diagnose.model.sensor_noise import sensor_noises
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.plant_words import balance_told, constant_told, in_its_words
from firmloop.diagnose.policy import (
    COUNTED_SAMPLES,
    FIRM_TO_SAY,
    HARDLY_MEANT,
    HINT_OF_CHANCE,
    MINOR_SHARE,
    MOST_DIGITS,
    SHOWN_RMS,
    SOFT_EVIDENCE,
    STEPS_OF_A_FIT,
    TIE,
    UNLIKE_NOISE,
    USUAL_WITHIN,
    WHITENESS_LAGS,
)
from firmloop.diagnose.search.found import Search, as_near, candidates_of, richer_of, standing
from firmloop.diagnose.search.improved import blurred, directs
from firmloop.diagnose.search.simulation_error import needed
from firmloop.diagnose.search.usual_values import untold
from firmloop.diagnose.sentences import paragraph
from firmloop.identify.fitting.noise import Noise, flat, whiteness
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.attach import acts_at, parameters_of
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.plant import Plant

Array = NDArray[np.float64]

_MET = "the recordings are met with"


def judge(search: Search, checks: Preflight, shape: Shape | None) -> tuple[Finding, Shape | None]:
    """Choose the verdict and write it down; with it what has no name, where that is the verdict and simulates better.

    `shape` is what the best explanation leaves.
    """
    seen = replace(search, problem=replace(search.problem, test=()))  # what is unseen takes part in no choice
    read = directs(search)
    verdict, candidates = _verdict(seen, shape, read)
    if read and verdict == "no_mismatch":
        verdict = "explained"
    shown = search.best if verdict in ("explained", "ambiguous") else search.nominal
    if verdict != "unknown_physics":
        shape = None
    elif shape is None or shape.beside:  # not believed: what is missing is what the plant alone misses
        shape = best_shape(seen, search.nominal)
    told = shape if shape is not None and _helps(seen, shape) else None
    after = search.best.fitted.residuals if told is None else told.residuals
    row_by_row = replace(search.problem, samples=0.0)
    noises = search.best.noises if told is None and not search.problem.samples else noises_of(row_by_row, after)
    rounded = {each.output: each.values[0] / math.sqrt(12.0) for each in read if each.in_steps}
    pairs = zip(search.problem.plant.outputs, sensor_noises(after, search.problem.floors), strict=True)
    noise = tuple(max(size, rounded.get(signal.name, 0.0)) for signal, size in pairs)
    train = _ratios(search, shown, told, noise, False)
    test = _ratios(search, shown, None, noise, True) if search.problem.test else None
    effects = (*_named(search, shown, verdict, candidates), *(_read_off(search.problem, each) for each in read))
    untestable = {**checks.untestable, **_unseen_here(search, shown)}
    others = _alternatives(search, shown, candidates) if verdict in ("explained", "unknown_physics") else ()
    location = None if verdict == "no_mismatch" else _location(search, noises, shape, read, verdict)
    shifts = _shifts(search, shown)
    white = (
        whiteness(_innovations(search.nominal.fitted.residuals, noises), WHITENESS_LAGS),
        whiteness(_innovations(after, noises), WHITENESS_LAGS),
    )
    outputs = [signal.name for signal in search.problem.plant.outputs]
    finding = Finding(
        verdict=verdict,
        half="none" if verdict == "no_mismatch" else "plant",
        location=location,
        effects=effects,
        alternatives=tuple(each for each in others if each.name not in untestable),
        train=train,
        test=test,
        whiteness=white,
        noise=dict(zip(outputs, noise, strict=True)),
        shifts=shifts,
        untestable={name: why for name, why in untestable.items() if name not in {each.name for each in effects}},
        notes=(
            *checks.notes,
            *_far_from_given(search.problem.plant, shifts, deviations(shown.fitted), verdict),
            *(
                f"{each.output} is simulated without its steps, which its noise blurs"
                for each in blurred(search, shown, read)
            ),
        ),
        says=(),
        per_recording=own_of_all(search.problem, shown.fitted),
        law=_law(told),
    )
    return replace(finding, says=paragraph(finding, search, shape, candidates)), told


def spoiled(finding: Finding) -> Finding:
    """Return the finding where its explanation simulates something worse than the plain refit, or all no nearer."""
    said = (
        "Something is missing, but no effect of the library makes every simulation better: "
        f"{' + '.join(each.name for each in finding.effects)} came nearest, but simulates a recording worse than the "
        "plain refit, or what was left out of the fit no nearer, or by less than it still misses; the written project "
        "therefore is the refit."
    )
    notes = tuple(note for note in finding.notes if not note.startswith(_MET))  # by what is not written
    others = tuple(
        line for line in finding.says if line.startswith(("Seen where", *(f"Note: {note}" for note in notes)))
    )
    train = replace(finding.train, after=finding.train.refit)
    test = None if finding.test is None else replace(finding.test, after=finding.test.refit)
    shifts = tuple(replace(shift, after=shift.refit) for shift in finding.shifts)
    none = replace(finding, effects=(), alternatives=(), train=train, test=test, notes=notes, shifts=shifts)
    return replace(none, verdict="unknown_physics", says=(said, *others))


def _verdict(search: Search, shape: Shape | None, read: Sequence[Direct]) -> tuple[Verdict, tuple[Candidate, ...]]:
    """Return the verdict, and the explanations that stand beside the best one; `read` is what needs no search."""
    if not search.best.fitted.terms:
        # What a sensor in wide steps leaves may be as large as those.
        stepped = any(each.in_steps for each in read)
        unlike_noise = rivals_noise(search) or refused(search)
        missing = outweighs(shape, search.best.noises, 0.0) or (not stepped and unlike_noise)
        return ("unknown_physics" if missing else "no_mismatch"), ()
    explained = search.nominal.score - search.best.score
    if outweighs(shape, search.best.noises, explained):
        return "unknown_physics", ()
    least = doubtful(search.best.fitted, search.best.noises)
    if least is not None and least.effect.lasting and not _needed(search, least):
        return "unknown_physics", ()  # it is the slow disturbance itself, or what else has no name
    shows = _shows(search)
    bar = TIE if shows else max(TIE, MINOR_SHARE * explained)
    tied = [each for each in standing(search) if each.score - search.best.score < bar]
    tied += [
        candidate
        for candidate in richer_of(search)
        if search.best.score - candidate.score > _hint(search, candidate, shows)
    ]
    known = {term for each in tied for term in each.fitted.terms}
    # What shows has to be met clearly better, for all its usual values; below the noise it is enough to be met as well.
    tied += [each for each in untold(search, -TIE if shows else USUAL_WITHIN) if each.fitted.terms[-1] not in known]
    return ("ambiguous" if tied else "explained"), tuple(tied)


def refused(search: Search) -> bool:
    """Tell whether an effect that leads simulations further off brought more than noise lets one bring."""
    tried, base = (each for candidates in search.rounds for each in candidates), search.nominal.likeliest
    return any(base.score - each.score > UNLIKE_NOISE and larger(each, base) for each in tried)


def _needed(search: Search, term: LibraryTerm) -> bool:
    """Tell whether simulations come far nearer by a term of the best."""
    problem, fitted = search.problem, search.best.fitted
    slim = fit(problem, problem.train, *without(fitted, term), flat(search.best.noises), STEPS_OF_A_FIT)
    return needed(fitted, slim, term)


def _hint(search: Search, candidate: Candidate, shows: bool) -> float:
    """Return what a richer explanation is to be better by, though it is not named, so that it stands beside the best.

    Below the noise its further parameters have to be no chance by the ratio of likelihoods (Wilks 1938), though BIC may
    ask more. Otherwise a slow disturbance may be all that a load's moment gains by, and it may not be.
    """
    if shows:
        return TIE if candidate.fitted.terms[-1].effect.lasting else math.inf
    best = search.best.fitted
    rows = sum(part.size for part in best.residuals)
    more = max(len(candidate.fitted.coordinates) - len(best.coordinates), 1)
    return float(scipy.special.chdtri(more, 1.0 - HINT_OF_CHANCE)) - more * math.log(rows)


def _shows(search: Search) -> bool:
    """Tell whether what is missing is as large as the noise in some output: below it all rests on the noise model.

    Where independent samples are counted, no such model is asked.
    """
    if any(noise.scale > COUNTED_SAMPLES * noise.rms for noise in search.best.noises):
        return True
    before, after = residual_sizes(search.nominal.fitted.residuals), residual_sizes(search.best.fitted.residuals)
    return any(one > SHOWN_RMS * other for one, other in zip(before, after, strict=True))


def _innovations(residuals: Sequence[Array], noises: Sequence[Noise]) -> tuple[Array, ...]:
    """Return the whitened residuals (n,) of every recording and output."""
    return tuple(noise.whiten(part[:, index]) for part in residuals for index, noise in enumerate(noises))


def _read_off(problem: Problem, each: Direct) -> Named:
    effect = find_effect(each.effect)
    estimates = {
        known.name: Estimate(value, (value - NORMAL_95 * deviation, value + NORMAL_95 * deviation), known.unit)
        for known, value, deviation in zip(
            parameters_of(problem.plant, each.effect, each.output), each.values, each.deviations, strict=True
        )
    }
    figures = ", ".join(f"{name} {_with_interval(estimate)}" for name, estimate in estimates.items())
    says = f"{in_its_words(problem.plant, effect.says.rstrip('.'))} ({each.output}): {figures}."
    return Named(each.effect, each.output, "sensor", 1.0, estimates, says, str(each.output))


def _ratios(search: Search, shown: Candidate, shape: Shape | None, noise: Sequence[float], unseen: bool) -> Ratio:
    """Residual rms over noise rms, over all outputs; only initial states are fitted. What has no name explains, too."""
    problem = search.problem
    recordings = problem.test if unseen else problem.train
    given = {p.name: p.value for p in problem.plant.parameters}
    before = fit_starts(problem, recordings, given, search.best.noises)
    refit, after = (
        unseen_residuals(problem, each.fitted, search.best.noises) if unseen else each.fitted.residuals
        for each in (search.nominal, shown)
    )
    if shape is not None:
        after = shape.residuals
    lefts = ([residual_of(problem, recording, before, k) for k, recording in enumerate(recordings)], refit, after)
    figures = [relative(parts, noise) for parts in lefts]
    return Ratio(*(figure if math.isfinite(figure) else None for figure in figures))


def _named(search: Search, shown: Candidate, verdict: Verdict, candidates: Sequence[Candidate]) -> tuple[Named, ...]:
    if verdict in ("no_mismatch", "unknown_physics"):
        return ()
    fits = [shown, *candidates]
    weights = _weights(fits, untold=True)
    found: dict[str, Named] = {}
    order = sorted(shown.fitted.terms, key=lambda term: -strength(shown.fitted, term))
    for candidate, terms in [(shown, order), *((each, list(each.fitted.terms)) for each in candidates)]:
        for term in terms:
            if term.label not in found:
                share = sum(w for w, each in zip(weights, fits, strict=True) if term in each.fitted.terms)
                if not candidates:
                    share = _weights([shown, *standing(search)])[0]  # against the runner-up
                certain = math.erf(strength(candidate.fitted, term) / math.sqrt(2.0))  # that it is not nothing
                found[term.label] = _one(search.problem, candidate, term, min(share, certain))
    surest_first = sorted(found.values(), key=lambda each: -each.probability) if candidates else found.values()
    return tuple(surest_first)


def _weights(candidates: Sequence[Candidate], untold: bool = False) -> list[float]:
    """Return the probability of each; of those `untold` from one another none is said to be next to nothing."""
    behind = np.array([candidate.score for candidate in candidates]) - min(candidate.score for candidate in candidates)
    softer = max(float(behind.max()) / TIE, 1.0) if untold else 1.0
    raw = np.exp(-0.5 * behind / (SOFT_EVIDENCE * softer))
    return [float(each) for each in raw / raw.sum()]


def _one(problem: Problem, candidate: Candidate, term: LibraryTerm, probability: float) -> Named:
    spread, alone = deviations(candidate.fitted), beside_scale(candidate.fitted)
    values, estimates = as_written(candidate.fitted.point.values), {}
    for key, each in zip(term.keys, term.parameters, strict=True):
        value = values.get(key, each.neutral)
        reach, sure = (NORMAL_95 * known.get(key, math.inf) for known in (spread, alone))
        interval = interval_of(each, value, reach, sure)
        estimates[each.name] = Estimate(value, interval, each.unit)
    place = term.place_told(problem.plant)
    plant, acts = problem.plant, term.effect.place
    if plant.delay is not None and acts == "torque" and not plant.moves:
        place = balance_told(plant, acts)
    says = in_its_words(plant, term.effect.says.rstrip(".")) + (f" ({place})" if place else "")
    names = {name: constant_told(plant, name, acts) for name in estimates}
    figures = ", ".join(f"{names[name]} {_with_interval(each)}" for name, each in estimates.items())
    return Named(
        term.effect.name,
        term.output,
        _equation(problem, term),
        probability,
        estimates,
        f"{says}: {figures}." if figures else f"{says}.",
        acts_at(problem.plant, term.use({})),
    )


def _equation(problem: Problem, term: LibraryTerm) -> str:
    linear = any(balance.kind == "force" for balance in problem.plant.balances)
    return "force" if term.effect.equation == "torque" and linear else term.effect.equation


def _with_interval(each: Estimate) -> str:
    unit = "" if each.unit in ("", "1") else f" {each.unit}"
    if each.interval is None:
        return f"{each.value:.4g}{unit} (interval unknown)"
    low, high = each.interval
    half = 0.5 * (high - low)
    if low * high > 0.0 and half >= abs(each.value):  # it is known by a factor
        return f"{each.value:.2g} ({low:.2g} to {high:.2g}){unit}"
    told = math.log10(abs(each.value) / half) if half > 0.0 and each.value != 0.0 else 0.0
    digits = min(max(4, math.ceil(told) + 2), MOST_DIGITS)  # a gain of 1.0003 that is known to 3e-5 is not 1
    return f"{each.value:.{digits}g} ± {half:.2g}{unit}"


def _alternatives(search: Search, shown: Candidate, candidates: Sequence[Candidate]) -> tuple[Alternative, ...]:
    found: dict[str, Alternative] = {}
    others = [candidate for candidate in candidates_of(search) if candidate not in candidates][:4]
    near = [each if as_near(search, each) else replace(each, score=math.inf) for each in others]
    weights = _weights([shown, *near])
    mine = set(shown.fitted.terms)
    for weight, candidate in zip(weights[1:], others, strict=True):
        for term in candidate.fitted.terms:
            if term not in mine and term.effect.name not in found:
                test = in_its_words(search.problem.plant, term.effect.experiment)
                found[term.effect.name] = Alternative(term.effect.name, weight, test)
    return tuple(found.values())


def _helps(search: Search, shape: Shape) -> bool:
    """Tell whether simulations come nearer by a shape."""
    return relative(shape.residuals, residual_sizes(search.nominal.fitted.residuals)) < 1.0


def _law(shape: Shape | None) -> tuple[tuple[float, float], ...]:
    if shape is None or not np.any(shape.points[:, 1]):
        return ()
    return tuple((float(at), float(term)) for at, term in shape.points)


def _location(
    search: Search, noises: Sequence[Noise], shape: Shape | None, read: Sequence[Direct], verdict: Verdict
) -> Location:
    output, spans = worst_spans(search, noises)
    if shape is not None:
        equation, coordinate = shape.balance, shape.coordinate
    elif not search.best.fitted.terms and read:
        equation, coordinate = "sensor", find_effect(read[0].effect).term
    elif not search.best.fitted.terms:  # no law holds what is missing: it is known only when
        equation, coordinate = next((each.kind for each in search.problem.plant.balances), "actuator"), "time"
    else:
        term = max(search.best.fitted.terms, key=lambda each: strength(search.best.fitted, each))
        equation, coordinate = _equation(search.problem, term), term.effect.coordinate or term.effect.term
    where = ", ".join(f"{low:.2f}-{high:.2f} s" for low, high in spans)
    evidence = f"the refitted nominal plant misses {output}" + (f" most at {where}" if where else "")
    if verdict == "unknown_physics":
        evidence += gathered(search, output, spans)
    return Location(equation, coordinate, output, spans, evidence)


def _shifts(search: Search, shown: Candidate) -> tuple[Shift, ...]:
    refit, after = search.nominal.fitted.point.values, shown.fitted.point.values
    return tuple(
        Shift(p.name, p.unit, p.value, refit.get(p.name, p.value), after.get(p.name, p.value))
        for p in search.problem.plant.parameters
        if p.free
    )


def _far_from_given(plant: Plant, shifts: Sequence[Shift], spread: Mapping[str, float], verdict: Verdict) -> list[str]:
    """Say which nominal parameters the recordings determine well, and far from where the project has them."""
    if verdict == "unknown_physics":
        return []  # they may have moved to imitate what has no name
    fitted = {each.name for each in plant.parameters if each.deviation is not None}  # by identify: nobody gave them
    return [
        f"{_MET} {' '.join(filter(None, (f'{each.name} = {each.after:.3g}', each.unit)))}, "
        f"{each.after / each.given:.2g} times what the project gives; check its value and "
        f"{'sign' if each.after / each.given < 0.0 else 'unit'}"
        for each in shifts
        if each.name not in fitted
        and each.given * each.after != 0.0
        and (each.after / each.given < 0.0 or abs(math.log(each.after / each.given)) > math.log(HARDLY_MEANT))
        and spread.get(each.name, math.inf) < FIRM_TO_SAY * abs(each.after)
    ]


def _unseen_here(search: Search, shown: Candidate) -> dict[str, str]:
    """List effects of whose trace next to nothing is left once the nominal parameters have moved."""
    named = set(shown.fitted.names)
    best: dict[str, float] = {}
    for each in search.screened:
        best[each.term.effect.name] = max(best.get(each.term.effect.name, 0.0), each.left)
    return {
        name: "a change of the nominal parameters does the same to these outputs"
        for name, left in best.items()
        if left < 0.02 and name not in named
    }
