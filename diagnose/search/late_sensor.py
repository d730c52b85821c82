"""Put a late sensor in the place of a late input where waves follow a recorded angle: that is as late as its sensor."""

from __future__ import annotations

from dataclasses import replace

from firmloop.diagnose.model.angle import strayed
from firmloop.diagnose.model.candidate import Candidate, rated
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem, turning
from firmloop.diagnose.policy import ANGLE_AMENDMENTS, STEPS_OF_A_FIT, TIE
from firmloop.diagnose.search.exchange import exchanged
from firmloop.diagnose.search.found import Search


def retimed(found: Search) -> Search:
    """Return the search with one late term in the place of another, where that explains more beside its own angle.

    One that is only tied stays a candidate beside it.
    """
    problem, best = found.problem, found.best
    if not (turning(best.fitted.terms) and problem.engine.recorded):
        return found
    tried = []
    for gone, come in [
        (one, other) for one in best.fitted.terms for other in problem.terms if _as_late(best, one, other)
    ]:
        held = problem.engine.strayed
        other = _in_place(problem, best, gone, come)
        tried.append(other)
        if best.score - other.score > TIE:
            return replace(found, best=other, rounds=(*found.rounds, (best, *tried)))
        problem.engine.amend(held)
    return replace(found, rounds=(*found.rounds, tuple(tried))) if tried else found


def _as_late(best: Candidate, gone: LibraryTerm, come: LibraryTerm) -> bool:
    """Tell whether one term is late as another, which the best has not, and by as many seconds."""
    same = [each.unit for each in gone.parameters] == [each.unit for each in come.parameters]
    late = gone.effect.late and come.effect.name in gone.effect.confusable_with
    return late and same and come not in best.fitted.terms


def _in_place(problem: Problem, best: Candidate, gone: LibraryTerm, come: LibraryTerm) -> Candidate:
    """Fit one term in the place of another, as late at first, beside the angle that it tells."""
    start = {**problem.starts[come.label][0], come.keys[0]: best.fitted.point.values[gone.keys[0]]}
    noises = best.noises
    one = rated(problem, fit(problem, problem.train, *exchanged(best.fitted, gone, come, start), noises, 0))
    for _ in range(ANGLE_AMENDMENTS):
        held, before = problem.engine.strayed, one
        problem.engine.amend(strayed(problem, one))
        one = rated(problem, fit(problem, problem.train, one.fitted.terms, one.fitted.point, noises, STEPS_OF_A_FIT))
        if before.score - one.score < TIE:
            problem.engine.amend(held)
            return before
        noises = one.noises
    return one
