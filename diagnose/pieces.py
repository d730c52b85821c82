"""Search on recordings cut in pieces: over a short while no simulation strays far from what was recorded.

A fit of the whole takes a wrong angle, place or direction of motion from a simulation that has drifted away, and the
right effect then explains little (multiple shooting: Bock 1981). A piece begins where it was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from firmloop.diagnose.hypothesis import Cause, Point, Scene
from firmloop.diagnose.plain import strays
from firmloop.diagnose.rank import Progress, Search, accepted, search
from firmloop.diagnose.refit import fit, noises_of
from firmloop.diagnose.rival import Rival, larger, rated, tells
from firmloop.diagnose.round import CLEAR, LONG
from firmloop.identify.fitting.noise import Noise, flat
from firmloop.identify.recordings.recording import Recording

_PIECES, _LEAST = 8, 200  # pieces of a recording, and rows of one


def in_pieces(found: Search, progress: Progress) -> Search | None:
    """Return a search that begins with what explains the pieces, if that explains clearly more of the whole, too."""
    scene = found.scene
    if not strays(found) or any(cause.effect.place == "timing" for cause in found.best.fitted.causes):
        return None  # a clock that runs slow is late from the beginning of a piece
    train, test = _cut(scene.train), _cut(scene.test)
    if len(train) == len(scene.train):
        return None
    engine = scene.engine
    followed, off, longest = engine.recorded, engine.strayed, engine.longest_change
    engine.amend({})
    best = search(replace(scene, train=train, test=test, memory={}), progress).best.fitted
    engine.hasten(longest)
    rival = None
    if best.causes:
        firsts = [sum(_count(each) for each in scene.train[:k]) for k in range(len(scene.train))]
        begin = Point(best.point.values, tuple(best.point.starts[k] for k in firsts))
        rival = _whole(scene, best.causes, begin, best.noises)
    base = found.nominal
    if rival is None or found.best.score - rival.score < CLEAR or larger(rival, base) or not tells(rival, base):
        engine.follow(followed)
        engine.amend(off)
        return None
    rival = accepted(scene, rival)
    return replace(found, best=rival, rounds=(*found.rounds, (rival,)), gains=(base.score - rival.score,))


def _cut(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return all recordings in pieces, one after the other."""
    found = []
    for each in recordings:
        count, rows = _count(each), len(each.time)
        found += [each.part(k * rows // count, (k + 1) * rows // count) for k in range(count)]
    return tuple(found)


def _count(recording: Recording) -> int:
    """Return in how many pieces a recording is cut."""
    return min(max(len(recording.time) // _LEAST, 1), _PIECES)


def _whole(scene: Scene, causes: Sequence[Cause], point: Point, noises: Sequence[Noise]) -> Rival:
    """Fit to the whole recordings what the pieces told."""
    plain = fit(scene, scene.train, causes, point, flat(noises), LONG)
    return rated(scene, fit(scene, scene.train, causes, plain.point, noises_of(scene, plain.residuals), LONG))
