"""Give a reading that has lost its sign back the likely one, so that a fit can begin on the right side of zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.unwrap import with_column
from firmloop.diagnose.data.viterbi import cheapest
from firmloop.diagnose.model.fit import Fitted, fit, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, entered, first_point, outputs_of
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.policy import SIGN_AWAY, SIGN_BEND, SIGN_MOST, SIGN_ROUNDS, STEPS_FROM_GIVEN, STEPS_OF_A_FIT
from firmloop.identify.fitting.noise import Noise, flat, white

Array = NDArray[np.float64]


def from_unfolded(problem: Problem, term: LibraryTerm) -> Fitted:
    """Fit the nominal plant to readings with the likely sign, and from there the term that has taken it away."""
    output = str(term.output)
    index = [signal.name for signal in problem.plant.outputs].index(output)
    point = first_point(problem, problem.train)
    seen, lefts = problem.train, [residual_of(problem, each, point, k) for k, each in enumerate(problem.train)]
    noises: tuple[Noise, ...] = ()
    for _ in range(SIGN_ROUNDS):
        expected = [
            outputs_of(problem, each)[:, index] - left[:, index] for each, left in zip(seen, lefts, strict=True)
        ]
        seen = tuple(
            with_column(each, output, _signs(each.columns[output], near) * each.columns[output])
            for each, near in zip(problem.train, expected, strict=True)
        )
        if not noises:
            spreads = np.std(np.concatenate([outputs_of(problem, each) for each in seen]), axis=0)
            noises = tuple(white(max(float(size), 1e-12)) for size in spreads)
        part = replace(problem, train=seen, memory={})
        one = fit(part, seen, (), point, noises, STEPS_OF_A_FIT)
        noises = flat(noises_of(problem, one.residuals))
        one = fit(part, seen, (), one.point, noises, STEPS_OF_A_FIT)
        point, lefts = one.point, list(one.residuals)
    values = entered(point.values, term, problem.starts[term.label][0])
    return fit(problem, problem.train, (term,), Point(values, point.starts), noises, STEPS_FROM_GIVEN)


def _signs(seen: Array, expected: Array) -> Array:
    """Return the signs (n,) by which a reading bends little and goes where it is expected.

    The places of a row are its sign and that of the one before.
    """
    pairs = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])  # (this, before)
    follows = pairs[None, :, 1] == pairs[:, None, 0]  # from, to
    usual = max(float(np.median(np.abs(np.diff(seen, 2)))), 1e-12)
    size = max(float(np.max(np.abs(seen))), 1e-12)
    away = SIGN_AWAY * np.abs(pairs[None, :, 0] * seen[:, None] - np.nan_to_num(expected)[:, None]) / size

    def bend(row: int) -> Array:
        """Return what a row and the two before it cost, the sign of the last of them that of the old place."""
        turned = pairs[None, :, 0] * seen[row + 1] - 2.0 * pairs[None, :, 1] * seen[row]
        bent = np.abs(turned + pairs[:, None, 1] * seen[row - 1])
        return np.asarray(np.where(follows, np.minimum(bent / (SIGN_BEND * usual), SIGN_MOST), np.inf))

    places = cheapest(away[1:], bend)
    return np.concatenate([pairs[places[:1], 1], pairs[places, 0]])
