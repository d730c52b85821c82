"""Before something is called unknown: try every cause from all its starts, whatever a screen had promised."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from firmloop.diagnose.hypothesis import first_point
from firmloop.diagnose.rank import Search, accepted
from firmloop.diagnose.refit import Fitted, evidence, fit, noises_of, own_evidence
from firmloop.diagnose.rival import TIE, extended, larger, rated, tells
from firmloop.diagnose.round import LAST, LONG, SHORT, every_start
from firmloop.diagnose.screen import Screened
from firmloop.identify.fitting.noise import flat

_FINAL = 3  # causes fitted to the end
_SHARE = 0.25  # of what the best explains, that a trial has to explain after a few steps
_PATIENCE = 32.0  # million steps of simulation after which no further cause is tried


def exhausted(found: Search) -> Search | None:
    """Return a search that begins with the one cause that explains more than all of the best does; None if none."""
    scene, base = found.scene, found.nominal
    without = evidence(base.fitted, base.noises)
    worth = _SHARE * (without - evidence(found.best.fitted, found.best.noises))
    until = scene.engine.steps + _PATIENCE
    known = [each.cause for each in found.screened]
    rest = [(cause, scene.starts[cause.label]) for cause in scene.causes if cause not in known]
    every = (*found.screened, *(Screened(cause, 0.0, starts[0], 0.0) for cause, starts in rest if starts))
    # A nominal plant that was refitted without an effect may no longer come to the place where it acts.
    bases = (base.fitted, replace(base.fitted, point=first_point(scene, scene.train)))
    told: dict[str, list[tuple[float, Fitted]]] = {}
    # Whitened edges are traps in which the search has looked already.
    for noises in (flat(base.noises), base.noises):
        for each in every:
            from_bases = bases if each.cause.effect.needs_position else bases[:1]
            for start, begun in product(every_start(scene, each), from_bases):
                if scene.engine.steps < until:
                    one = fit(scene, scene.train, *extended(begun, each.cause, start), noises, SHORT)
                    told.setdefault(each.cause.label, []).append((own_evidence(scene, one), one))
    trials = [min(fits, key=lambda pair: pair[0]) for fits in told.values()]
    trials.sort(key=lambda pair: pair[0])
    rivals = []
    for trial in [each for score, each in trials if without - score > worth][:_FINAL]:
        longer = fit(scene, scene.train, trial.causes, trial.point, noises_of(scene, trial.residuals), LONG)
        ended = fit(scene, scene.train, trial.causes, longer.point, noises_of(scene, longer.residuals), LAST)
        rivals.append(rated(scene, ended))
    best = min(rivals, key=lambda each: each.score, default=base)
    if found.best.score - best.score < TIE or larger(best, base) or not tells(best, base):
        return None
    rounds = (*found.rounds, tuple(sorted(rivals, key=lambda each: each.score)))
    best = accepted(scene, best)
    return replace(found, best=best, rounds=rounds, gains=(base.score - best.score,))
