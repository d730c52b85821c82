"""Prefer, among explanations that are told apart no better, the one by which every recording begins at rest.

Where all readings begin a little off zero, a sensor reads that much at rest, or all runs began with the machine already
moving at just the speed that the sensor's offset would be: the same function, but hardly the same chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.descent import Problem
from firmloop.diagnose.hypothesis import Point, Scene
from firmloop.diagnose.rank import Search, rivals_of
from firmloop.diagnose.refit import fit_starts, inverse
from firmloop.diagnose.rival import TIE, Rival

Array = NDArray[np.float64]

_STILL, _MOVING = 3.0, 5.0  # deviations of a beginning from rest, up to which a machine rests and from which it moves
_REST = TIE  # what a recording that begins in motion tells against it, where another tied explanation begins at rest


def rested(found: Search) -> Search:
    """Return the search with explanations that begin in motion put behind where another, tied with them, rests."""
    best = found.best
    tied = [rival for rival in rivals_of(found) if rival.score - best.score < TIE]
    if not best.fitted.causes or not tied or not found.scene.engine.engine.sticking:
        return found
    begun = {frozenset(each.fitted.causes): _begins(found.scene, each) for each in (*reversed(tied), best)}
    if not any(np.all(away < _STILL) for away in begun.values()):
        return found
    behind = _REST * (len(found.scene.train) + len(found.scene.test))
    moving = {causes for causes, away in begun.items() if np.all(away > _MOVING)}

    def put_back(rival: Rival) -> Rival:
        return replace(rival, score=rival.score + behind) if frozenset(rival.fitted.causes) in moving else rival

    first = min(map(put_back, (best, *tied)), key=lambda each: each.score)
    rounds = tuple(tuple(map(put_back, turn)) for turn in found.rounds)
    return replace(found, best=first, rounds=(*rounds, (put_back(best),)))


def _begins(scene: Scene, rival: Rival) -> Array:
    """Return how far from rest all recordings begin, in deviations of the states but for positions."""
    kept = [k for k, name in enumerate(scene.engine.states) if not name.startswith("position")]
    unseen = fit_starts(scene, scene.test, rival.fitted.point.values, rival.noises)
    starts = (*rival.fitted.point.starts, *unseen.starts)
    found = []
    for recording, start in zip((*scene.train, *scene.test), starts, strict=True):
        problem = Problem(scene, [recording], (), rival.noises, np.zeros((0, 1)))
        place = problem.at(Point(rival.fitted.point.values, (start,)))
        spread = inverse(problem.normal(problem.slopes(place)))[np.ix_(kept, kept)]
        found.append(max(float(start[kept] @ inverse(spread) @ start[kept]), 0.0) ** 0.5)
    return np.array(found)
