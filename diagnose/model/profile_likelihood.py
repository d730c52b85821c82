"""Try out how far an effect's parameters may move: a deviation is a promise about the cost, and it may be broken.

A standard deviation tells of a cost that rises as a parabola: by 4 two deviations away. That of a moment, a limit or a
gap has kinks, and rises as a random walk does. The interval is then where the cost has risen by 3.84, which is its
95 % (the profile likelihood; Venzon & Moolgavkar, Applied Statistics 37 (1988) 87-94), the other unknowns following
along the parabola's own path, or fitted anew beside a contact: one that is elsewhere moves all that follow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.fit import Fitted, cost_at, ended, fit, inverse, moved, widened
from firmloop.diagnose.model.hypothesis import MOMENT, Point, Problem
from firmloop.diagnose.policy import (
    CHI_SQUARED_95,
    PROFILE_GAIN,
    PROFILE_REACHES,
    PROFILE_SCAN,
    PROFILE_TURNS,
    STEPS_OF_A_NEAR_FIT,
)
from firmloop.identify.fitting.noise import Noise

Array = NDArray[np.float64]


def profiled(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Return the fit with deviations as far as the cost allows; from a better place, should one be met on the way."""
    for _ in range(PROFILE_TURNS):
        factors, better = _tried(problem, fitted, noises)
        if better is None:
            return widened(fitted, factors)
        fitted = ended(problem, replace(fitted, point=better, wider=None), noises)
    return fitted


def _tried(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> tuple[Array, Point | None]:
    """Return by what deviations (k,) have to be widened, and the best place met where that is better than the fit."""
    factors = np.ones(len(fitted.coordinates))
    covariance = inverse(fitted.normal)
    here = cost_at(problem, fitted, fitted.point, noises)
    best, least = None, here - PROFILE_GAIN
    own = {key for term in fitted.terms for key in term.keys}
    met = {key for term in fitted.terms if term.effect.contact for key in term.keys}
    for index, each in enumerate(fitted.coordinates):
        spread = float(np.sqrt(max(covariance[index, index], 0.0)))
        if each.name not in own or not 0.0 < spread < np.inf:
            continue
        path = covariance[:, index] / spread
        for reach in PROFILE_SCAN if each.name.endswith(MOMENT) else ():
            place = moved(problem, fitted, reach * path)
            cost = cost_at(problem, fitted, place, noises)
            if cost < least:
                best, least = place, cost
        for sign in (1.0, -1.0):
            before, risen = 0.0, 0.0
            for reach in PROFILE_REACHES:
                place = moved(problem, fitted, sign * reach * path)
                cost = cost_at(problem, fitted, place, noises)
                if each.name in met and cost - here >= CHI_SQUARED_95:
                    place, cost = _followed(problem, fitted, noises, each.name, place, cost)
                if cost < least:
                    best, least = place, cost
                rise = max(cost - here, risen)
                if rise >= CHI_SQUARED_95:
                    crossed = before + (reach - before) * (np.sqrt(CHI_SQUARED_95) - np.sqrt(risen)) / (
                        np.sqrt(rise) - np.sqrt(risen)
                    )
                    factors[index] = max(factors[index], crossed / np.sqrt(CHI_SQUARED_95))
                    break
                before, risen = reach, rise
            else:
                factors[index] = max(factors[index], PROFILE_REACHES[-1] / np.sqrt(CHI_SQUARED_95))
    return factors, best


def _followed(
    problem: Problem, fitted: Fitted, noises: Sequence[Noise], held: str, place: Point, cost: float
) -> tuple[Point, float]:
    """Fit all unknowns but one anew from a place; return where that ends and its cost, or the same if it is no less."""
    other = fit(problem, problem.train, fitted.terms, place, noises, STEPS_OF_A_NEAR_FIT, held=(held,)).point
    less = cost_at(problem, fitted, other, noises)
    return (other, less) if less < cost else (place, cost)
