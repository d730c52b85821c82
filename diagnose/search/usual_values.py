"""Ask whether a richer effect of usual size would have shown: where not, nothing tells the simpler one from it.

Evidence alone always prefers the simpler of two that recordings cannot tell apart: it pays for every parameter as if
nothing were known of it. Held at usual values, what is richer has as many unknowns as what is simpler, and is a
candidate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.candidate import Candidate, containing, rated
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import LibraryTerm, searched
from firmloop.diagnose.policy import IMPOSSIBLE, STEPS_BESIDE_USUAL
from firmloop.diagnose.search.exchange import alike, exchanged
from firmloop.diagnose.search.found import Search, richer_of

Array = NDArray[np.float64]


def untold(search: Search, bar: float) -> tuple[Candidate, ...]:
    """Return the richer explanations with usual values of what they add whose BIC is less than `bar` above the best.

    What they add is held. A moment has no usual value.
    """
    problem, best, found = search.problem, search.best, []
    for gone in best.fitted.terms:
        for come in problem.terms:
            rich = come.effect.name in containing(gone.effect.name) and come not in best.fitted.terms
            if rich and not searched(come) and _least(search, come) - best.score < bar:
                one = min(_usual(search, gone, come), key=lambda each: each.score)
                if one.score - best.score < bar:
                    found.append(one)
    return tuple(found)


def _least(search: Search, come: LibraryTerm) -> float:
    """Return the least BIC that usual values can have: that of the same explanation fitted freely, less its price.

    A fit that has ended where no machine is tells none.
    """
    best = search.best.fitted
    price = math.log(sum(part.size for part in best.residuals))
    return min(
        (
            each.score - price * (len(each.fitted.coordinates) - len(best.coordinates))
            for each in richer_of(search)
            if come in each.fitted.terms and each.score < IMPOSSIBLE
        ),
        default=-math.inf,
    )


def _usual(search: Search, gone: LibraryTerm, come: LibraryTerm) -> Iterator[Candidate]:
    """Fit one term in the place of another that it contains, from each start, what it adds held there."""
    problem, fitted = search.problem, search.best.fitted
    same: dict[str, str] = {}
    for key, own in alike(gone, come).items():
        if own not in same.values():  # what contains an effect of one parameter has that as its first
            same[key] = own
    units = {key: each.unit for key, each in zip(come.keys, come.parameters, strict=True)}
    first, shared = next(iter(same)), {key: fitted.point.values[theirs] for key, theirs in same.items()}
    seen: list[Array] = []
    for start in problem.starts[come.label]:
        # What is added in proportion to a size is usual beside the size that was found.
        ratio = shared[first] / start[first]
        added = {
            key: value * ratio if units[key].startswith(units[first]) else value
            for key, value in start.items()
            if key not in same
        }
        held = np.array(list(added.values()))
        if not any(np.allclose(held, other) for other in seen):
            seen.append(held)
            begin = exchanged(fitted, gone, come, {**added, **shared})
            one = fit(problem, problem.train, *begin, search.best.noises, STEPS_BESIDE_USUAL, held=tuple(added))
            yield rated(problem, one)
