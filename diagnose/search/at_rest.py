"""Prefer, among explanations that are told apart no better, the one by which every recording begins at rest.

Where all readings begin a little off zero, a sensor reads that much at rest, or all runs began with the machine already
moving at just the speed that the sensor's offset would be: the same function, but hardly the same chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate, worth_their_price
from firmloop.diagnose.model.descent import SumOfSquares
from firmloop.diagnose.model.fit import inverse
from firmloop.diagnose.model.hypothesis import Point, Problem
from firmloop.diagnose.policy import AT_REST, IN_MOTION, TIE
from firmloop.diagnose.search.found import Search, candidates_of

Array = NDArray[np.float64]


def rested(found: Search) -> Search:
    """Return the search with explanations that begin in motion put behind where another, tied with them, rests."""
    best = found.best
    tied = [candidate for candidate in candidates_of(found) if candidate.score - best.score < TIE]
    if not best.fitted.terms or not tied or not found.problem.engine.engine.sticking:
        return found
    begun = {frozenset(each.fitted.terms): _begins(found.problem, each) for each in (*reversed(tied), best)}
    if not any(np.all(away < AT_REST) for away in begun.values()):
        return found
    behind = TIE * (len(found.problem.train) - 0.5)  # one recording that begins so may have; two leave nothing open
    moving = {terms for terms, away in begun.items() if np.all(away > IN_MOTION)}

    def put_back(candidate: Candidate) -> Candidate:
        return (
            replace(candidate, score=candidate.score + behind)
            if frozenset(candidate.fitted.terms) in moving
            else candidate
        )

    first = min(worth_their_price([*map(put_back, (best, *tied))]), key=lambda each: each.score)
    rounds = tuple(tuple(map(put_back, turn)) for turn in found.rounds)
    return replace(found, best=first, rounds=(*rounds, (put_back(best),)))


def _begins(problem: Problem, candidate: Candidate) -> Array:
    """Return how far from rest all recordings begin, in deviations of the states but for positions."""
    own = {one.state for one in problem.plant.varying}
    kept = [k for k, name in enumerate(problem.engine.states) if not name.startswith("position") and k not in own]
    found = []
    for recording, start in zip(problem.train, candidate.fitted.point.starts, strict=True):
        squares = SumOfSquares(problem, [recording], (), candidate.noises, np.zeros((0, 1)))
        place = squares.at(Point(candidate.fitted.point.values, (start,)))
        spread = inverse(squares.normal(squares.slopes(place)))[np.ix_(kept, kept)]
        found.append(max(float(start[kept] @ inverse(spread) @ start[kept]), 0.0) ** 0.5)
    return np.array(found)
