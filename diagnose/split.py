"""Put a simpler effect and one more in the place of a richer one: what bends a friction may be another's doing."""

from __future__ import annotations

from dataclasses import replace

from firmloop.diagnose.hypothesis import Cause
from firmloop.diagnose.plain import independent, leap, simulated_beside
from firmloop.diagnose.rank import Search, accepted
from firmloop.diagnose.rival import RICHER, Rival, larger
from firmloop.identify.fitting.noise import colored

_MOST = 0.5  # of what the best explains, that a simpler one has to explain
_MEMORY = 1.5  # ratio of residual and innovation rms, from which something is left to explain


def split(found: Search) -> Search | None:
    """Return a search with the simpler effect and one beside it, where those explain more; None where none do."""
    best, explained = found.best, found.nominal.score - found.best.score
    if not any(colored([noise]) and noise.rms > _MEMORY * noise.scale for noise in best.noises):
        return None
    for gone in best.fitted.causes:
        simple = _simpler(found, gone)
        if simple is None or simple.score - best.score > (1.0 - _MOST) * explained:
            continue
        lost = simple.score - best.score
        begin = replace(found, best=simple, gains=(*found.gains[:-1], found.gains[-1] - lost))
        more = leap(begin, simulated_beside(found.scene, simple.fitted, independent(simple.fitted.residuals)))
        if more is not None and best.score - more.best.score > RICHER and not larger(more.best, best):
            # The next effect would take what is left where this one has not come to its end.
            return replace(more, best=accepted(found.scene, more.best))
    return None


def _simpler(found: Search, gone: Cause) -> Rival | None:
    """Return the best that was tried with an effect that `gone` contains in its place; bodies that meet keep theirs."""
    if gone.effect.contact:
        return None
    others = set(found.best.fitted.causes) - {gone}
    tried = [
        each
        for turn in found.rounds
        for each in turn
        if len(each.fitted.causes) == len(others) + 1
        and others < set(each.fitted.causes)
        and (set(each.fitted.causes) - others).pop().effect.name in gone.effect.contains
    ]
    return min(tried, key=lambda each: each.score, default=None)
