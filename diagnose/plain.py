"""Search by plain simulation error, where what a model leaves over is no noise but more of the same slow misfit.

A noise model of long memory calls a slow misfit noise and looks at the quick rest, in which the physics may not show at
all: a tank that runs over, a fan's drag. Here residuals count as they are, in as many independent samples as their
autocorrelation leaves (Bartlett 1935), and an effect has to make the unseen recordings better too.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.given import from_given
from firmloop.diagnose.hypothesis import Cause, Scene, first_point, searched
from firmloop.diagnose.lasting import by_chance
from firmloop.diagnose.orders import best_orders
from firmloop.diagnose.polish import polished
from firmloop.diagnose.rank import MOST_EFFECTS, SLOW_THRESHOLD, THRESHOLD, Progress, Search, pruned
from firmloop.diagnose.refit import Fitted, fit, noises_of
from firmloop.diagnose.rival import (
    Rival,
    believable,
    by_luck,
    creeps,
    extended,
    memories,
    rated,
    relieved,
    rms_of,
    simplest,
    unseen_residuals,
)
from firmloop.diagnose.screen import ground, screen
from firmloop.diagnose.swap import merged, plainer, swapped
from firmloop.identify.fitting.noise import Noise, colored

Array = NDArray[np.float64]

_SLOW = 4.0  # residual rms over innovation rms from which a misfit may be slow
_CLEAR = 0.9  # ratio of unseen residual rms from which this search is believed instead of the one by innovations
_HALF = 0.5  # such a ratio, by what lasts, that no slow disturbance has by chance on unseen recordings too
_FARTHER = 1.1  # such a ratio from which what only whitens the rest is no explanation
_LEAP = 0.6  # ratio of residual rms that weighs more than innovations which prefer another explanation
_FAR = 0.8  # such a ratio on test, that does where train is clearly better too
_CLOSE = 0.7  # such a ratio on train, up to which innovations may be against the first of several effects
_EVIDENCE = 100.0  # drop of BIC by innovations that this search's explanation has to bring too
_SHARE = 0.5  # of what the other search's explanation brings
_SURE = 0.4  # such a ratio with which it is enough that the evidence does not contradict, or is that of a drift
_BARE = 1.5  # residual rms over innovation rms, up to which next to no misfit is left
_DRIFTS = 2.0 * THRESHOLD  # drop of BIC by innovations that what drifts has to bring even so
_WORSE = 1.2  # such a ratio on test, from which an effect is none
_BETTER = 0.97  # ratio of residual rms that every effect has to bring, on train and on test
_TRIED, _FINAL = 6, 3  # causes fitted in a round, and of them to the end
_STARTS = 2  # points a fit begins from, but for moments: they were searched beside a linear plant
_SHORT, _LONG = 5, 15  # steps of a fit
_THRESHOLD = 12.0  # drop of BIC, in independent samples; the unseen recordings have to confirm it
_RICHER = 8.0  # the same of a richer effect beside the simpler one that it contains
_SAME = 0.5  # of what all effects have brought, that may be missing where one is put in the place of what it amounts to
_OTHER = 3.0  # factor on a nominal parameter from which an explanation is about another machine
_DRIFT = 0.02  # of an output's spread: what a slow disturbance may do
_ROUND = 5.0  # s of computing after which a round tries no further cause
_PATIENCE = 25.0  # s of computing after which no further effect is looked for


def believed(found: Search, slow: Sequence[Rival], progress: Progress) -> Search:
    """Return the search by innovations, or one by simulation error where that predicts unseen recordings far better.

    `slow` are the effects that were tried last beside what was found. A disturbance that a plant sums up is met by many
    an effect, on unseen recordings too: innovations have to agree.
    """
    scene = found.scene
    if not scene.test or not strays(found):
        return found
    plain, evidence = plain_search(found, slow if not found.best.fitted.causes else (), progress)
    explained = found.nominal.score - found.best.score
    if evidence > max(_EVIDENCE, _SHARE * explained):
        train, test = _ratios(scene, plain.best.fitted, found.best.fitted)
        better = train < 1.0 and test < (_CLEAR if evidence > explained else _LEAP)
        better |= train < _CLEAR and test < _FAR
        if better and not _idle(found, plain.best.fitted, evidence - explained):
            return _whitened(found, _refined(plain))
    return _simulated(found) if found.best.fitted.causes else found


def nearer(scene: Scene, one: Fitted, other: Fitted, share: float = _CLEAR) -> bool:
    """Tell whether the simulations of one explanation leave less than a share of another's, of unseen ones too."""
    return max(_ratios(scene, one, other)) < share


def needed(scene: Scene, fitted: Fitted, slim: Fitted, gone: Cause) -> bool:
    """Tell whether simulations come so much nearer by a cause than without, `slim`, that no disturbance is all it is.

    What lasts soaks up what drifts, too, though hardly on unseen recordings as well.
    """
    lasting = gone.effect.lasting
    return nearer(scene, fitted, slim, _HALF if lasting else _CLEAR) and (bool(scene.test) or not lasting)


def farther(scene: Scene, one: Fitted, other: Fitted) -> bool:
    """Tell whether the simulations of one explanation are further off than those of another, unseen ones too."""
    return min(_ratios(scene, one, other)) > _FARTHER


def _idle(found: Search, fitted: Fitted, gain: float) -> bool:
    """Tell whether what a fit adds to what was found is no more than a disturbance, or counts against it.

    `gain` is the drop of BIC by innovations that the fit brings beside what was found.
    """
    ours, theirs = set(found.best.fitted.causes), set(fitted.causes)
    added = theirs - ours
    if by_chance(found.scene, fitted, noises_of(found.scene, fitted.residuals), added, gain):
        return True
    if not ours < theirs:
        return False
    if gain < SLOW_THRESHOLD and any(_drifts(fitted, cause) for cause in added):
        return True
    return gain < 0.0 and not any(creeps(cause, fitted.point.values) for cause in added)


def _simulated(found: Search) -> Search:
    """Return the same effects with the parameters of least simulation error, where unseen recordings prefer them."""
    scene, best = found.scene, found.best
    sizes = _sizes(independent(best.fitted.residuals))
    fitted = fit(scene, scene.train, best.fitted.causes, best.fitted.point, sizes, _LONG)
    train, test = _ratios(scene, fitted, best.fitted)
    if train >= 1.0 or test >= _CLEAR:
        return found
    counted = fit(scene, scene.train, fitted.causes, fitted.point, independent(fitted.residuals), 1)
    return replace(found, best=Rival(counted, noises_of(scene, counted.residuals), best.score))


def _evidence(found: Search, fitted: Fitted) -> float:
    """Return the drop of BIC by innovations that an explanation brings beside the nominal plant of the other search."""
    scene = found.scene
    return found.nominal.score - min(rated(scene, fitted).score, _by_innovations(scene, fitted).score)


def _by_innovations(scene: Scene, fitted: Fitted) -> Rival:
    """Fit the same effects from there by the innovations of what is left."""
    noises = noises_of(scene, fitted.residuals)
    return rated(scene, fit(scene, scene.train, fitted.causes, fitted.point, noises, _LONG))


def _refined(plain: Search) -> Search:
    """Polish the best explanation of a search by simulation error, and drop what then no longer makes it better."""
    scene, best = plain.scene, plain.best
    finer = polished(scene, best.fitted, best.noises)
    while len(finer.causes) > 1:
        sizes = _sizes(independent(finer.residuals))
        slimmer = [
            fit(scene, scene.train, *relieved(scene, finer, cause, sizes), sizes, _LONG) for cause in finer.causes
        ]
        least = min(slimmer, key=lambda each: each.cost)
        if min(_ratios(scene, finer, least)) < _BETTER:
            break
        finer = polished(scene, least, best.noises)
    allowed = 1.0 if len(finer.causes) == len(best.fitted.causes) else 1.0 / _BETTER
    if _size(finer.residuals, best.fitted.residuals) < allowed and _same_machine(scene, plain.nominal.fitted, finer):
        return replace(plain, best=_rated(scene, finer, independent(finer.residuals)))
    return plain


def _whitened(found: Search, plain: Search) -> Search:
    """Return an explanation with the parameters that its innovations tell, unless unseen recordings are against them.

    Simulation error counts a slow disturbance as if the parameters had to make up for it: where the effects are right,
    innovations tell their size better, in a closed loop most of all.
    """
    scene, fitted = found.scene, plain.best.fitted
    best = _by_innovations(scene, fitted)
    simulated = rated(scene, fitted)
    if best.score >= simulated.score or _ratios(scene, fitted, best.fitted)[1] < _CLEAR:
        whole = merged(scene, simulated, found.nominal.score - simulated.score).fitted
        return replace(plain, best=_rated(scene, whole, independent(whole.residuals))) if whole is not fitted else plain
    if not colored(best.noises):
        best = pruned(scene, best)  # where nothing slow is left, evidence tells what only led there
    gain = found.nominal.score - best.score
    best, tried = swapped(scene, best, gain)
    best = merged(scene, best, gain)
    return replace(found, best=best, rounds=((best,), tried), gains=(gain,))


def strays(found: Search, share: float = _DRIFT) -> bool:
    """Tell whether an explanation leaves a slow misfit that is not small, a `share` of it, beside the motion."""
    scene, noises = found.scene, found.best.noises
    spreads = [np.concatenate([each.columns[s.name] for each in scene.train]).std() for s in scene.plant.outputs]
    large = any(noise.rms > share * spread for noise, spread in zip(noises, spreads, strict=True))
    return large and max(noise.rms / noise.scale for noise in noises) > _SLOW


def slow_rivals(found: Search, progress: Progress) -> tuple[Rival, ...]:
    """Try each effect beside what was found by what the simulations then miss; none where no misfit is slow."""
    scene, best = found.scene, found.best
    if not scene.test or not strays(found):
        return ()
    progress(0.7, "looking for what moves slowly")
    noises = independent(best.fitted.residuals)
    given = () if best.fitted.causes else from_given(scene, best)
    return simulated_beside(scene, best.fitted, noises, given)


def leap(found: Search, rivals: Sequence[Rival]) -> Search | None:
    """Add the effect after which the simulations miss far less, on unseen recordings too, if the evidence agrees.

    Innovations hardly see what moves slowly; but what makes the simulations right is no noise. `rivals` are what was
    tried by what the simulations miss, best first; what the search tried last and found too little may do as well.
    Where no misfit is slow there are none, and an effect has to leave hardly more than innovations.
    """
    scene, best = found.scene, found.best
    if not scene.test:
        return None
    mine = set(best.fitted.causes)
    more = [each for turn in found.rounds[-2:] for each in turn if mine < set(each.fitted.causes)]
    for one in (*rivals[:1], *sorted(more, key=lambda each: each.score)[:_FINAL]):
        ratio = _least_ratio(scene, one.fitted, best.fitted)
        if not ratio <= (_LEAP if rivals else _SURE):  # nor where one of them has diverged
            continue
        again = _by_innovations(scene, one.fitted)
        if not rivals and max(noise.rms / noise.scale for noise in again.noises) > _BARE:
            continue
        gain = best.score - again.score
        if by_chance(scene, again.fitted, again.noises, again.fitted.causes[-1:], gain):
            continue
        drifts = _drifts(one.fitted, one.fitted.causes[-1])
        least, sure = (SLOW_THRESHOLD, _DRIFTS) if drifts else (THRESHOLD, 0.0 if rivals else _DRIFTS)
        if gain >= (least if ratio > _SURE else sure):
            nominal = found.nominal if found.gains else best
            rounds, gains = (*found.rounds, (again,)), (*found.gains, gain)
            return replace(found, nominal=nominal, best=again, rounds=rounds, gains=gains)
    return None


def _drifts(fitted: Fitted, cause: Cause) -> bool:
    """Tell whether a disturbance may drift as an effect does, in all recordings."""
    return creeps(cause, fitted.point.values) and cause.effect.place == "torque"


def _least_ratio(scene: Scene, one: Fitted, other: Fitted) -> float:
    """Return the ratio of residual rms, the larger of train and test, of the output that a further effect is about.

    Infinite where another output is worse for it: by more than a slow disturbance makes of that, on test at least by
    a fifth.
    """
    left = _unseen(scene, one)
    train, test = _sizes_of(one.residuals, other.residuals), _sizes_of(left, _unseen(scene, other))
    worse = np.any(train > np.fmax(by_luck(one.residuals), 1.0 / _BETTER))
    worse |= np.any(test > np.fmax(by_luck(left), _WORSE))
    return np.inf if worse else float(np.min(np.maximum(train, test)))


def plain_search(found: Search, begin: Sequence[Rival], progress: Progress) -> tuple[Search, float]:
    """Grow an explanation effect by effect, each the one after which the simulations miss least.

    `begin` are the single effects if they have been tried already. Return the evidence by innovations too.
    """
    progress(0.7, "looking for what moves slowly")
    begun = time.process_time()
    scene = found.scene
    nominal = _nominal(scene, found)
    best = nominal
    rounds: list[tuple[Rival, ...]] = []
    gains: list[float] = []
    evidence = 0.0
    while len(gains) < MOST_EFFECTS and time.process_time() - begun < _PATIENCE:
        noises = independent(best.fitted.residuals)
        known = tuple(_rated(scene, each.fitted, noises) for each in begin if not gains)
        tried = known or simulated_beside(scene, best.fitted, noises)
        rivals = tuple(each for each in tried if _same_machine(scene, nominal.fitted, each.fitted))
        if not rivals:
            break
        base = _rated(scene, best.fitted, noises)
        chosen = simplest(rivals, base.score, _RICHER)
        rounds.append(rivals)
        if base.score - chosen.score < _THRESHOLD or max(_ratios(scene, chosen.fitted, base.fitted)) > _BETTER:
            break
        gains.append(base.score - chosen.score)
        best = _amounting(scene, chosen, nominal, noises)
        nominal = base if len(gains) == 1 else nominal
        evidence = _evidence(found, best.fitted)
        if evidence < 0.0 and _size(best.fitted.residuals, nominal.fitted.residuals) > _CLOSE:
            break
    return Search(scene, nominal, best, tuple(rounds), found.screened, tuple(gains)), evidence


def _amounting(scene: Scene, best: Rival, nominal: Rival, noises: Sequence[Noise]) -> Rival:
    """Put the simpler effect in the place of one whose values amount to it, unless most is lost: others are to come."""
    for each in plainer(scene, replace(best, noises=_sizes(noises))):
        one, before = (_rated(scene, fitted, noises) for fitted in (each.fitted, nominal.fitted))
        if one.score - best.score < _SAME * (before.score - best.score):
            return one
    return best


def _same_machine(scene: Scene, nominal: Fitted, fitted: Fitted) -> bool:
    """Tell whether all nominal parameters that cannot vanish are near where they were given, or the nominal plant."""
    given = first_point(scene, scene.train)
    for each in nominal.coordinates:
        if each.logarithmic:
            here, *others = (each.inner(point.values[each.name]) for point in (fitted.point, nominal.point, given))
            if min(abs(here - other) for other in others) > np.log(_OTHER):
                return False
    return True


def _nominal(scene: Scene, found: Search) -> Rival:
    noises = independent(found.nominal.fitted.residuals)
    starts = (found.nominal.fitted.point, first_point(scene, scene.train))
    fits = [fit(scene, scene.train, (), start, _sizes(noises), _LONG) for start in starts]
    best = min(fits, key=lambda each: each.cost)
    return _rated(scene, best, noises)


def simulated_beside(
    scene: Scene, base: Fitted, noises: Sequence[Noise], begun: Sequence[Fitted] = ()
) -> tuple[Rival, ...]:
    """Fit the most promising causes by simulation error, from several points; the best are fitted to the end.

    `noises` count independent samples; `begun` are trials that began elsewhere.
    """
    causes = [cause for cause in scene.causes if cause not in base.causes]
    grounds = [ground(scene, scene.train, base, noises)]
    (screened,) = screen(scene, scene.train, base, causes, grounds, best_orders(scene, base, grounds))
    trials: list[Fitted] = []
    more: list[Fitted] = []
    until = time.process_time() + _ROUND
    for each in screened[:_TRIED]:
        if trials and time.process_time() > until:
            break
        others = [start for start in scene.starts[each.cause.label] if dict(start) != dict(each.start)]
        starts = [each.start, *(others if searched(each.cause) else others[: _STARTS - 1])]
        fits = [fit(scene, scene.train, *extended(base, each.cause, start), _sizes(noises), _SHORT) for start in starts]
        trials.append(min(fits[:_STARTS], key=lambda one: one.cost))
        more += fits[_STARTS:]
    trials += [fit(scene, scene.train, each.causes, each.point, _sizes(noises), _SHORT) for each in begun]
    trials.sort(key=lambda each: each.cost)
    lucky = [each for each in sorted(more, key=lambda each: each.cost)[:1] if each.cost < trials[0].cost]
    final = [*trials[:_FINAL], *lucky]  # what had more chances takes nobody's place
    longer = [fit(scene, scene.train, each.causes, each.point, _sizes(noises), _LONG) for each in final]
    return tuple(sorted((_rated(scene, each, noises) for each in longer), key=lambda each: each.score))


def _rated(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Rival:
    """Score by residual rms in independent samples, on train and test, with BIC's price of an unknown.

    Infinite after a divergence and where an effect has values that are not its own.
    """
    if not believable(fitted):
        return Rival(fitted, tuple(noises), np.inf)
    score = 0.0
    for residuals in (fitted.residuals, _unseen(scene, fitted)):
        stacked = np.concatenate(residuals)
        if not np.all(np.isfinite(stacked)):
            return Rival(fitted, tuple(noises), np.inf)
        for index, noise in enumerate(noises):
            count = len(stacked) * (noise.rms / noise.scale) ** 2
            score += count * float(np.log(np.mean(stacked[:, index] ** 2)))
    rows = sum(len(part) * (noise.rms / noise.scale) ** 2 for part in fitted.residuals for noise in noises)
    return Rival(fitted, tuple(noises), score + len(fitted.coordinates) * float(np.log(max(rows, 2.0))))


def _unseen(scene: Scene, fitted: Fitted) -> tuple[Array, ...]:
    """Return what is left of the test recordings; only their initial states are fitted."""
    return unseen_residuals(scene, fitted, independent(fitted.residuals))


def _ratios(scene: Scene, one: Fitted, other: Fitted) -> tuple[float, float]:
    """Return the residual rms of one explanation over that of another, on train and on test."""
    return _size(one.residuals, other.residuals), _size(_unseen(scene, one), _unseen(scene, other))


def _size(one: Sequence[Array], other: Sequence[Array]) -> float:
    """Return the rms of one set of residuals over that of another, the mean over outputs of their squares."""
    return float(np.sqrt(np.mean(_sizes_of(one, other) ** 2)))


def _sizes_of(one: Sequence[Array], other: Sequence[Array]) -> Array:
    """Return the rms (r,) of every output's residuals over that of another set; infinite after a divergence."""
    sizes = [rms_of(parts) for parts in (one, other)]
    return np.asarray(np.nan_to_num(sizes[0] / np.maximum(sizes[1], 1e-150), nan=np.inf, posinf=np.inf))


def independent(residuals: Sequence[Array]) -> tuple[Noise, ...]:
    """Return white noise whose scale is that of the mean of independent samples: rms times sqrt(1 + 2 sum rho^2)."""
    made = []
    for index, kept in enumerate(memories(residuals)):
        rms = max(float(np.sqrt(np.mean(np.concatenate([part[:, index] for part in residuals]) ** 2))), 1e-30)
        made.append(Noise(np.zeros(0), rms * float(np.sqrt(kept)), rms))
    return tuple(made)


def _sizes(noises: Sequence[Noise]) -> tuple[Noise, ...]:
    """Return white noise of the same rms, every sample of which counts: what a fit minimizes."""
    return tuple(Noise(noise.coefficients, noise.rms, noise.rms) for noise in noises)
