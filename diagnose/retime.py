"""Put a late sensor in the place of a late input where waves follow a recorded angle: that is as late as its sensor."""

from __future__ import annotations

from dataclasses import replace

from firmloop.diagnose.angle import strayed
from firmloop.diagnose.hypothesis import Cause, Scene, turning
from firmloop.diagnose.rank import Search
from firmloop.diagnose.refit import fit
from firmloop.diagnose.rival import TIE, Rival, rated
from firmloop.diagnose.round import LONG
from firmloop.diagnose.swap import exchanged

_TIMES = 8  # that the angle is amended, each by the last fit, as long as that explains more


def retimed(found: Search) -> Search:
    """Return the search with one late cause in the place of another, where that explains more beside its own angle.

    One that is only tied is a rival.
    """
    scene, best = found.scene, found.best
    if not (turning(best.fitted.causes) and scene.engine.recorded):
        return found
    tried = []
    for gone, come in [
        (one, other) for one in best.fitted.causes for other in scene.causes if _as_late(best, one, other)
    ]:
        held = scene.engine.strayed
        other = _in_place(scene, best, gone, come)
        tried.append(other)
        if best.score - other.score > TIE:
            return replace(found, best=other, rounds=(*found.rounds, (best, *tried)))
        scene.engine.amend(held)
    return replace(found, rounds=(*found.rounds, tuple(tried))) if tried else found


def _as_late(best: Rival, gone: Cause, come: Cause) -> bool:
    """Tell whether one cause is late as another, which the best has not, and by as many seconds."""
    same = [each.unit for each in gone.parameters] == [each.unit for each in come.parameters]
    late = gone.effect.late and come.effect.name in gone.effect.confusable_with
    return late and same and come not in best.fitted.causes


def _in_place(scene: Scene, best: Rival, gone: Cause, come: Cause) -> Rival:
    """Fit one cause in the place of another, as late at first, beside the angle that it tells."""
    start = {**scene.starts[come.label][0], come.keys[0]: best.fitted.point.values[gone.keys[0]]}
    noises = best.noises
    one = rated(scene, fit(scene, scene.train, *exchanged(best.fitted, gone, come, start), noises, 0))
    for _ in range(_TIMES):
        held, before = scene.engine.strayed, one
        scene.engine.amend(strayed(scene, one))
        one = rated(scene, fit(scene, scene.train, one.fitted.causes, one.fitted.point, noises, LONG))
        if before.score - one.score < TIE:
            scene.engine.amend(held)
            return before
        noises = one.noises
    return one
