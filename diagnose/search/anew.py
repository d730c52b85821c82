"""Search anew where what a search has left is no noise: by how near simulations come alone, or in short pieces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate, larger, rated, without
from firmloop.diagnose.model.fit import fit, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem
from firmloop.diagnose.policy import (
    CLEAR_GAIN,
    CLOSER_RMS,
    EXCHANGE_PATIENCE,
    IMPOSSIBLE,
    MISFIT_SAMPLES,
    MOST_EFFECTS,
    PIECES,
    ROWS_OF_A_PIECE,
    SEARCH_PATIENCE,
    STEPS_OF_A_FIT,
    WORTH_A_REFIT,
)
from firmloop.diagnose.search.found import Progress, Search
from firmloop.diagnose.search.round import screened, tried_beside
from firmloop.diagnose.search.simulation_error import answers, nearer, unlike_noise
from firmloop.diagnose.search.stepwise import accepted, further, search, settled
from firmloop.identify.fitting.noise import Noise, flat, oversized
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.superset import Superset

Array = NDArray[np.float64]


class Settings(NamedTuple):
    """How a simulator is set, so that a search that finds nothing leaves it as it was."""

    recorded: bool
    lost: float
    strayed: Mapping[int, Array]
    longest_change: float

    @classmethod
    def of(cls, engine: Superset) -> Settings:
        """Return how a simulator is set now."""
        return cls(engine.recorded, engine.lost, engine.strayed, engine.longest_change)

    def restore(self, engine: Superset) -> None:
        """Set a simulator like that."""
        engine.hasten(self.longest_change)
        engine.follow(self.recorded)
        engine.lose(self.lost)
        engine.amend(self.strayed)


def by_simulation(found: Search, progress: Progress) -> Search | None:
    """Return a search that begins with what simulates far nearer than the best; None where nothing does.

    A model of noise foretells a slow misfit row by row, so that what explains it gains hardly anything, and of readings
    that are held or averaged innovations tell details. What answers the input counts as a few independent samples: as
    many as make a fall to CLOSER_RMS worth the threshold. It goes on as long as what is left does answer. Where that is
    far more than the sensors' noise in the end, the problem of the search stays one of a misfit.
    """
    if not answers(found):
        return None
    problem, before = found.problem, Settings.of(found.problem.engine)
    progress(0.8, "looking at simulation error alone")
    until = problem.engine.steps + SEARCH_PATIENCE
    plain = search(replace(problem, samples=MISFIT_SAMPLES, memory={}), lambda *_: None, 1, found.refit)
    while answers(plain) and 0 < len(plain.best.fitted.terms) < MOST_EFFECTS and problem.engine.steps < until:
        more = further(plain)
        if more is None:
            break
        plain = more
    if not plain.best.fitted.terms or not nearer(plain.best.fitted, found.best.fitted, CLOSER_RMS):
        before.restore(problem.engine)
        return None
    if unlike_noise(problem, plain.best):
        return plain
    possible = [[each for each in turn if each.score < IMPOSSIBLE] for turn in plain.rounds]
    rounds = tuple(tuple(rated(problem, each.fitted) for each in turn) for turn in possible)
    best = rated(problem, plain.best.fitted)
    return replace(found, best=best, rounds=(*found.rounds, *rounds), gains=(found.nominal.score - best.score,))


def in_pieces(found: Search, progress: Progress) -> Search | None:
    """Return a search that begins with what explains the pieces, if that explains clearly more of the whole, too.

    Over a short while no simulation strays far from what was recorded. A fit of the whole takes a wrong angle, place or
    direction of motion from a simulation that has drifted away, and the right effect then explains little (multiple
    shooting: Bock 1981). A piece begins where it was recorded.
    """
    problem = found.problem
    if not oversized(found.best.noises) or any(term.effect.place == "timing" for term in found.best.fitted.terms):
        return None  # a clock that runs slow is late from the beginning of a piece
    train = _cut(problem.train)
    if len(train) == len(problem.train):
        return None
    engine, before = problem.engine, Settings.of(problem.engine)
    engine.amend({})
    best = search(replace(problem, train=train, memory={}), progress, 1).best.fitted  # the rest goes on with the whole
    engine.hasten(before.longest_change)
    candidate = None
    if best.terms:
        firsts = [sum(_count(each) for each in problem.train[:k]) for k in range(len(problem.train))]
        begin = Point(best.point.values, tuple(best.point.starts[k] for k in firsts))
        candidate = _whole(problem, best.terms, begin, best.noises)
    base = found.nominal
    if candidate is None or found.best.score - candidate.score < CLEAR_GAIN or larger(candidate, base):
        before.restore(engine)
        return None
    candidate = accepted(problem, candidate)
    return replace(found, best=candidate, rounds=(*found.rounds, (candidate,)), gains=(base.score - candidate.score,))


def floated(found: Search) -> Search | None:
    """Return a search whose best has in the place of an effect what simulates far nearer; None where nothing does.

    What was found first may hide what it is not: beside the rest without it, every term is screened anew (floating
    search: Pudil, Novovicova & Kittler 1994).
    """
    problem, until, gone_on = found.problem, found.problem.engine.steps + EXCHANGE_PATIENCE, None
    while len(found.best.fitted.terms) > 1 and problem.engine.steps < until:
        best, tried = found.best, list[Candidate]()
        for gone in best.fitted.terms:
            if problem.engine.steps > until:
                break
            fitted = fit(problem, problem.train, *without(best.fitted, gone), best.noises, STEPS_OF_A_FIT)
            rest, others = rated(problem, fitted), tuple(each for each in problem.terms if each != gone)
            opened = replace(problem, terms=others)
            tried += tried_beside(opened, rest, screened(opened, rest), (), WORTH_A_REFIT)
        instead = min(tried, key=lambda each: each.score, default=best)
        far = best.score - instead.score > CLEAR_GAIN and nearer(instead.fitted, best.fitted, CLOSER_RMS)
        if not far or larger(instead, best):
            break
        gains = (*found.gains[:-1], found.gains[-1] + best.score - instead.score)
        rounds = (*found.rounds, tuple(sorted(tried, key=lambda each: each.score)))
        found = gone_on = settled(replace(found, best=accepted(problem, instead), rounds=rounds, gains=gains))
    return gone_on


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
