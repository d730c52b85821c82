"""Search on recordings cut in pieces: over a short while no simulation strays far from what was recorded.

A fit of the whole takes a wrong angle, place or direction of motion from a simulation that has drifted away, and the
right effect then explains little (multiple shooting: Bock 1981). A piece begins where it was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from firmloop.diagnose.model.candidate import Candidate, larger, rated
from firmloop.diagnose.model.fit import fit, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem
from firmloop.diagnose.policy import CLEAR_GAIN, PIECES, ROWS_OF_A_PIECE, STEPS_OF_A_FIT
from firmloop.diagnose.search.found import Progress, Search
from firmloop.diagnose.search.stepwise import accepted, search
from firmloop.identify.fitting.noise import Noise, flat, oversized
from firmloop.identify.recordings.recording import Recording


def in_pieces(found: Search, progress: Progress) -> Search | None:
    """Return a search that begins with what explains the pieces, if that explains clearly more of the whole, too."""
    problem = found.problem
    if not oversized(found.best.noises) or any(term.effect.place == "timing" for term in found.best.fitted.terms):
        return None  # a clock that runs slow is late from the beginning of a piece
    train = _cut(problem.train)
    if len(train) == len(problem.train):
        return None
    engine = problem.engine
    followed, lost, off, longest = engine.recorded, engine.lost, engine.strayed, engine.longest_change
    engine.amend({})
    best = search(replace(problem, train=train, memory={}), progress, 1).best.fitted  # the rest goes on with the whole
    engine.hasten(longest)
    candidate = None
    if best.terms:
        firsts = [sum(_count(each) for each in problem.train[:k]) for k in range(len(problem.train))]
        begin = Point(best.point.values, tuple(best.point.starts[k] for k in firsts))
        candidate = _whole(problem, best.terms, begin, best.noises)
    base = found.nominal
    if candidate is None or found.best.score - candidate.score < CLEAR_GAIN or larger(candidate, base):
        engine.follow(followed)
        engine.lose(lost)
        engine.amend(off)
        return None
    candidate = accepted(problem, candidate)
    return replace(found, best=candidate, rounds=(*found.rounds, (candidate,)), gains=(base.score - candidate.score,))


def _cut(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return all recordings in pieces, one after the other."""
    found = []
    for each in recordings:
        count, rows = _count(each), len(each.time)
        found += [each.part(k * rows // count, (k + 1) * rows // count) for k in range(count)]
    return tuple(found)


def _count(recording: Recording) -> int:
    """Return in how many pieces a recording is cut."""
    return min(max(len(recording.time) // ROWS_OF_A_PIECE, 1), PIECES)


def _whole(problem: Problem, terms: Sequence[LibraryTerm], point: Point, noises: Sequence[Noise]) -> Candidate:
    """Fit to the whole recordings what the pieces told."""
    plain = fit(problem, problem.train, terms, point, flat(noises), STEPS_OF_A_FIT)
    return rated(
        problem, fit(problem, problem.train, terms, plain.point, noises_of(problem, plain.residuals), STEPS_OF_A_FIT)
    )
