"""One round of a search: refit the most promising causes beside what was found, the best of them to the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from firmloop.diagnose.contact import PATIENCE, met, past_contacts
from firmloop.diagnose.given import afresh, runaways
from firmloop.diagnose.hypothesis import Scene
from firmloop.diagnose.orders import best_orders
from firmloop.diagnose.polish import limits
from firmloop.diagnose.refit import Fitted, evidence, fit, noises_of, own_evidence
from firmloop.diagnose.rival import IMPOSSIBLE, Rival, extended, rated, related
from firmloop.diagnose.screen import Screened, ground, screen
from firmloop.diagnose.swap import relatives
from firmloop.identify.fitting.noise import Noise, colored, flat, white

CLEAR = 150.0  # BIC by which a short fit is too far behind to catch up, or has clearly gained
SHORT, LONG, LAST = 3, 24, 4  # steps of a trial, of a final fit, and of one that only follows a new noise model
_TRIED = 5  # causes refitted per round, besides relatives
_FINAL = 4  # of them refitted to the end
_PROMISED = 3  # more of them, where no trial gains
_MET = 3  # starts from which a contact is followed further
_WHOLE = 0.999  # of the largest possible size, from which an effect had to be that large
_FEW = 8  # starts of a grid that are all followed
_INSISTED = 20.0  # million steps of simulation for what had promised much and gained nothing
_ROUND = 40.0  # million steps of simulation after which a round tries no further cause
_SHARE = 0.08  # of the best screened drop


def screened(scene: Scene, best: Rival) -> tuple[Screened, ...]:
    """Screen with the colored noise of what is left and with white noise: what is left may itself be the effect."""
    found = best.fitted.causes
    special = {name for cause in found for name in cause.effect.contains}  # cases of what is there already
    open_causes = [each for each in scene.causes if each not in found and each.effect.name not in special]
    under = [best.noises, flat(best.noises)] if colored(best.noises) else [best.noises]
    grounds = [ground(scene, scene.train, best.fitted, noises) for noises in under]
    orders = best_orders(scene, best.fitted, grounds)
    tables = screen(scene, scene.train, best.fitted, open_causes, grounds, orders)
    shaped, plain = ({each.cause.label: each for each in table} for table in (tables[0], tables[-1]))
    scale = max((each.gain for each in plain.values()), default=1.0) / max(
        max((each.gain for each in shaped.values()), default=1.0), 1.0
    )
    labels = sorted({*shaped, *plain})  # a cause may show under one noise model alone
    merged = [max((shaped.get(label), _scaled(plain.get(label), scale)), key=_gain) for label in labels]
    drops = {label: max(each.drop for each in (shaped.get(label), plain.get(label)) if each) for label in labels}
    raised = [replace(each, gain=max(each.gain, drops[each.cause.label])) for each in merged if each is not None]
    return tuple(sorted(raised, key=lambda each: -each.gain))


def _scaled(screened: Screened | None, scale: float) -> Screened | None:
    return None if screened is None else replace(screened, gain=screened.gain / max(scale, 1e-12))


def _gain(screened: Screened | None) -> float:
    return -1.0 if screened is None else screened.gain


def tried_beside(
    scene: Scene, best: Rival, screened: Sequence[Screened], others: Sequence[Fitted], worth: float
) -> tuple[Rival, ...]:
    """Refit the most promising causes and their relatives; the best are refitted to the end."""
    top = screened[0].gain if screened else 0.0
    picked = [each for each in screened[:_TRIED] if each.gain > max(worth, _SHARE * top)]
    trials = _trials(scene, best, screened, picked, others)
    without = evidence(best.fitted, best.noises)
    if trials and without - trials[0][0] < CLEAR:
        trials = sorted([*trials, *_insisted(scene, best, picked)], key=lambda pair: pair[0])
    if not trials:
        return ()
    final = _chosen(trials, picked, without)
    noises = noises_of(scene, final[0].residuals)
    longer = [fit(scene, scene.train, each.causes, each.point, noises, LONG) for each in final]
    told = [own_evidence(scene, each) for each in longer]
    longer = [
        _met(scene, each, noises) if score - min(told) < CLEAR else each
        for each, score in zip(longer, told, strict=True)
    ]
    noises = noises_of(scene, min(longer, key=lambda each: each.cost).residuals)
    ended = [fit(scene, scene.train, each.causes, each.point, noises, LAST) for each in longer]
    rivals = [rated(scene, each) for each in ended if not _too_large(each)]
    if not rivals:
        return ()
    best_one = min(rivals, key=lambda each: each.score)
    known = {each.fitted.causes for each in rivals if each.score < IMPOSSIBLE}
    return tuple(sorted([*rivals, *relatives(scene, best_one, known)], key=lambda each: each.score))


def _met(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Lead a fit past its contacts; where those are new, on a stretch that grows first."""
    return (met if fitted.causes[-1].effect.contact else past_contacts)(scene, fitted, noises, PATIENCE)


def _trials(
    scene: Scene, best: Rival, screened: Sequence[Screened], picked: Sequence[Screened], others: Sequence[Fitted]
) -> list[tuple[float, Fitted]]:
    """Fit what was picked and its relatives in a few steps; return all trials with their evidence, best first."""
    kin = {other for each in picked for other in related(each.cause.effect.name)}
    blind = not best.fitted.causes  # beside other effects, what no screen sees would be tried in every round
    more = [
        each
        for each in screened
        if each not in picked and (each.cause.effect.name in kin or (blind and not each.cause.effect.screened))
    ]
    found = [*reversed(others)]
    begun = scene.engine.steps
    away = bool(best.fitted.causes) and bool(runaways(scene, best.fitted))
    for each in [*picked, *more]:
        if found and scene.engine.steps - begun > _ROUND:
            break
        meeting = bool(each.cause.effect.contact) and each in picked  # bodies: every start has a valley of its own
        every = scene.starts[each.cause.label] if meeting else _starts(scene, each)
        begins = [extended(best.fitted, each.cause, start) for start in every]
        if away:
            begins.append(afresh(scene, best.fitted, each))
        fits = [fit(scene, scene.train, causes, begin, best.noises, SHORT) for causes, begin in begins]
        if meeting:
            first = sorted(fits, key=lambda one: one.cost)[:_MET]
            fits = [fit(scene, scene.train, one.causes, one.point, best.noises, LONG // 2) for one in first]
        found += [fitted for fitted in fits if not _too_large(fitted)]
    told = [(own_evidence(scene, each), each) for each in found]
    return sorted(told, key=lambda pair: pair[0])


def _insisted(scene: Scene, best: Rival, picked: Sequence[Screened]) -> list[tuple[float, Fitted]]:
    """Follow what promised much from all its starts as if all noise were white: whitened edges are traps."""
    sizes = [white(noise.scale) for noise in best.noises]
    found = []
    begun = scene.engine.steps
    for each in picked[:_PROMISED]:
        for start in every_start(scene, each):
            if each.gain > CLEAR and scene.engine.steps - begun < _INSISTED:
                fitted = fit(scene, scene.train, *extended(best.fitted, each.cause, start), sizes, LONG)
                if not _too_large(fitted):
                    found.append((own_evidence(scene, fitted), fitted))
    return found


def _chosen(trials: Sequence[tuple[float, Fitted]], picked: Sequence[Screened], without: float) -> list[Fitted]:
    """Return one fit of each of the best hypotheses, and of what promised most: of more where no trial gains.

    Of the best limit a second one: a higher one beside a larger gain may do the same on train, and not elsewhere.
    `without` is the evidence that there is without any.
    """
    final: list[Fitted] = []
    for score, fitted in trials:
        near = len(final) < 2 or score - trials[0][0] < CLEAR
        if near and len(final) < _FINAL and all(fitted.causes != other.causes for other in final):
            final.append(fitted)
    for each in picked[: _PROMISED if trials[0][0] > without else 1]:
        promised = next((fitted for _, fitted in trials if fitted.causes[-1] == each.cause), None)
        if promised is not None and all(promised.causes != other.causes for other in final):
            final.append(promised)
    second = (
        fitted
        for score, fitted in trials
        if score - trials[0][0] < CLEAR
        and limits(fitted.causes[-1:])
        and any(one.causes == fitted.causes and one is not fitted for one in final)
    )
    return [*final, *islice(second, 1)]


def _too_large(fitted: Fitted) -> bool:
    """Tell whether the newest effect had to be as large as it can be: it only stands for another."""
    newest = fitted.causes[-1]
    sizes = zip(newest.keys[:1], newest.parameters[:1], strict=True)
    bounded = [(key, each.high) for key, each in sizes if each.default is None and np.isfinite(each.neutral)]
    return any(fitted.point.values[key] > _WHOLE * high for key, high in bounded)


def every_start(scene: Scene, screened: Screened) -> Sequence[Mapping[str, float]]:
    """Return all starts of a cause; of a large grid, which was searched when it was screened, the one it promised."""
    starts = scene.starts[screened.cause.label]
    return starts if len(starts) <= _FEW else (screened.start,)


def _starts(scene: Scene, screened: Screened) -> list[Mapping[str, float]]:
    """Return the start that promises most, for effects of three parameters a second one, and for limits all.

    A limit that is set too low bends all else on its way up.
    """
    cause = screened.cause
    others = [dict(start) for start in scene.starts[cause.label] if dict(start) != dict(screened.start)]
    if limits([cause]):
        return [screened.start, *others]
    return [screened.start, *others[len(others) // 2 :][:1]] if len(cause.keys) >= 3 else [screened.start]
