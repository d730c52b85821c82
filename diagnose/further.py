"""Go on searching as long as what is left moves slowly or has a shape: a large effect must not hide a small one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from firmloop.diagnose.contact import met
from firmloop.diagnose.exhaust import exhausted
from firmloop.diagnose.hypothesis import Cause, Scene, meeting
from firmloop.diagnose.lasting import FEW, with_lasting
from firmloop.diagnose.pieces import in_pieces
from firmloop.diagnose.plain import independent, needed, strays
from firmloop.diagnose.polish import limits, polished
from firmloop.diagnose.profile import profiled
from firmloop.diagnose.pushes import doubtful, with_pushes
from firmloop.diagnose.rank import MOST_EFFECTS, THRESHOLD, Progress, Search, further, levelled, pruned, settled
from firmloop.diagnose.refit import Fitted, ended, evidence, fit, noises_of, strength
from firmloop.diagnose.rest import rested
from firmloop.diagnose.retime import retimed
from firmloop.diagnose.rival import MINOR, TIE, Rival, rated, without
from firmloop.diagnose.round import LONG
from firmloop.diagnose.scale_doubt import with_scale_doubt
from firmloop.diagnose.shape import Shape, best_shape, outweighs, weighed
from firmloop.identify.fitting.noise import colored, flat
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.simulation.course import LONGEST_CHANGE

LEFT = 60.0  # drop of BIC by a shape, from which an explanation is not the whole of it
_LITTLE = 150.0  # drop of BIC up to which a name says little
_STEPS, _SLIM = 12, 24  # of a fit without an effect, and of one as if noise had no memory
_POLISH = 30  # solves past kinks, of a few steps each
_CONTACTS = 80.0  # million steps of simulation where bodies meet
_VALLEYS = 4  # times that a fit goes on which a curved valley had held a deviation from its end
_LOST = 0.5  # of an output's spread: a misfit with which a simulation follows nothing
_PATCHED, _TRACE = 300.0, 0.05  # drop of BIC that an effect may owe to kinks, or share of all that is explained
_PATIENCE = 100.0  # million steps of simulation after which nothing further is looked for


def completed(found: Search, progress: Progress) -> tuple[Search, Shape | None]:
    """Return the search that is believed, with what slow misfits and shapes still show, and the shape that is left."""
    begun, tried = found.scene.engine.steps, found
    pieced = in_pieces(found, progress)
    if pieced is not None:
        found = _resumed(pieced)
    progress(0.75, "looking for what has no name")
    shape = best_shape(found, found.best)
    while (
        shape is not None
        and shape.gain > LEFT
        and len(found.best.fitted.causes) < MOST_EFFECTS
        and found.scene.engine.steps - begun < _PATIENCE
    ):
        more = further(found, weighed(found))
        rest = None if more is None else best_shape(more, more.best)
        if more is None or (rest is not None and rest.gain > shape.gain):
            break
        found, shape = more, rest
    alone = _alone(found)
    whole = not outweighs(shape, found.best.noises, found.nominal.score - found.best.score)
    if strays(found, _LOST) or alone is not None or not whole:
        others = (None if found is tried else in_pieces(found, progress), exhausted(found))
        other = min((each for each in others if each is not None), key=lambda each: each.best.score, default=None)
        if other is not None:
            found = _resumed(other)
            shape, alone = best_shape(found, found.best), _alone(found)
    if alone is not None:
        return replace(found, best=found.nominal), alone
    sure = _confirmed(rested(levelled(retimed(found))))
    if doubtful(sure.best.fitted, sure.best.noises) is not None:
        other = exhausted(found)
        if other is not None:
            found = _resumed(other)
            sure, shape = _confirmed(rested(levelled(found))), best_shape(found, found.best)
        elif len(sure.best.fitted.causes) == 1 and found.nominal.score - found.best.score < FEW:
            return replace(found, best=found.nominal), best_shape(found, found.nominal)
    return sure, shape


def _resumed(found: Search) -> Search:
    """Return the search gone on with until no effect is found beside it, and settled."""
    begun, gone_on = found.scene.engine.steps, None
    while len(found.best.fitted.causes) < MOST_EFFECTS and found.scene.engine.steps - begun < _PATIENCE:
        more = further(found)
        if more is None:
            break
        found = gone_on = more
    return gone_on or settled(found)


def _alone(found: Search) -> Shape | None:
    """Return the one shape that says more than several names; None where there is none.

    Or clearly more than one name, where unseen recordings speak against that, or far more where that says little.
    """
    best, nominal = found.best, found.nominal
    explained = nominal.score - best.score
    told = evidence(nominal.fitted, nominal.noises) - evidence(best.fitted, best.noises)
    least = 0.0 if len(best.fitted.causes) > 1 else LEFT if explained < told else LEFT + explained
    if not best.fitted.causes or (least > LEFT and explained > _LITTLE):
        return None
    shape = best_shape(found, nominal)
    return shape if shape is not None and shape.gain > explained + least else None


def _confirmed(found: Search) -> Search:
    """Fit the best once more by finer steps and with the noise it leaves, so that its intervals are its own.

    The score stays that of the search, by which rivals were compared; but an effect that only stood for how far the
    others were from their best goes.
    """
    scene, best = found.scene, found.best
    if not best.fitted.causes:
        return found
    scene.engine.hasten(LONGEST_CHANGE)
    finer = _finer(scene, best)
    if len(best.fitted.causes) > 1:
        whole = rated(scene, finer)
        slim = pruned(scene, whole) if abs(best.score - whole.score) > TIE else whole
        slim = _past_kinks(scene, slim, max(_PATCHED, _TRACE * (found.nominal.score - best.score)))
        if slim is not whole:
            finer = _finer(scene, slim)
    finer = _certain(scene, with_doubts(scene, finer))
    finer = _untraced(scene, finer, MINOR * (found.nominal.score - best.score))
    return replace(found, best=replace(best, fitted=finer, noises=noises_of(scene, finer.residuals)))


def _certain(scene: Scene, fitted: Fitted) -> Fitted:
    """Drop effects of which a slow disturbance leaves nothing certain, as long as simulations without come as near."""
    noises, plain = noises_of(scene, fitted.residuals), not colored(fitted.noises)
    while len(fitted.causes) > 1 and (least := doubtful(fitted, noises)) is not None:
        causes, point = without(fitted, least)
        slim = fit(scene, scene.train, causes, point, flat(noises), _SLIM)  # whitened edges are traps
        if needed(fitted, slim, least):
            break
        noises = noises_of(scene, slim.residuals)
        by = independent(slim.residuals) if plain else noises
        slim = fit(scene, scene.train, causes, slim.point, by, _STEPS)
        fitted = with_doubts(scene, profiled(scene, ended(scene, slim, by), by))
    return fitted


def _untraced(scene: Scene, fitted: Fitted, owed: float) -> Fitted:
    """Drop effects that may be none by their own intervals, beside white noise too, and brought less than `owed`."""
    while len(fitted.causes) > 1:
        least = min(fitted.causes, key=lambda cause: strength(fitted, cause))
        if strength(fitted, least) > NORMAL_95:
            break
        noises = noises_of(scene, fitted.residuals)
        slim = fit(scene, scene.train, *without(fitted, least), noises, _SLIM)
        if rated(scene, slim).score - rated(scene, fitted).score > owed:
            break
        fitted = with_doubts(scene, profiled(scene, ended(scene, slim, noises), noises))
    return fitted


def with_doubts(scene: Scene, fitted: Fitted) -> Fitted:
    """Widen the deviations to what slow disturbances and a torque constant as given leave of them."""
    noises = noises_of(scene, fitted.residuals)
    fitted = with_lasting(scene, with_pushes(scene, fitted, noises), noises)
    return with_scale_doubt(scene, fitted)


def _past_kinks(scene: Scene, rival: Rival, owed: float) -> Rival:
    """Drop effects that only make up for the kinks at which a fit of the others had ended.

    `owed` is the drop of BIC that an effect may owe to them.
    """
    for cause in rival.fitted.causes:
        causes, point = without(rival.fitted, cause)
        if not _kinked(causes, rival):
            continue
        slim = fit(scene, scene.train, causes, point, rival.noises, _STEPS)
        if rated(scene, slim).score - rival.score < owed:
            one = rated(scene, polished(scene, slim, rival.noises, _POLISH))
            rival = one if one.score - rival.score < THRESHOLD else rival
    return rival


def _kinked(causes: Sequence[Cause], rival: Rival) -> bool:
    """Tell whether plain squared error, which tells all where noise is white, has the kinks of limits."""
    return bool(limits(causes)) and not colored(rival.noises)


def _met(scene: Scene, rival: Rival) -> Fitted:
    """Lead a fit past the kinks of contacts, where there are any, by finer steps."""
    if not meeting(rival.fitted.causes):
        return rival.fitted
    return met(scene, ended(scene, rival.fitted, rival.noises), rival.noises, _CONTACTS)


def _finer(scene: Scene, rival: Rival) -> Fitted:
    """Take a fit to its end; past the kinks of limits, where noise is white and plain squared error tells all."""
    fitted, noises = _met(scene, rival), rival.noises
    if fitted is not rival.fitted:
        noises = noises_of(scene, fitted.residuals)
    if _kinked(fitted.causes, rival):
        fitted = polished(scene, fitted, noises, _POLISH)
    fitted = fit(scene, scene.train, fitted.causes, fitted.point, noises, 0)
    for _ in range(_VALLEYS):
        further_on = fit(scene, scene.train, fitted.causes, fitted.point, noises, LONG)
        if fitted.cost - further_on.cost < 1.0:
            break
        fitted = further_on
    return profiled(scene, ended(scene, fitted, noises), noises)
