"""Regress what drives a balance on the laws that it may follow: an equation is linear in them, a simulation is not.

Where the nominal plant follows nothing, slopes of its simulation do not tell what is missing. A motion that was
recorded tells its acceleration, and so what the balance lacks, row by row (equation error: Klein and Morelli, Aircraft
System Identification, 2nd ed., ch. 5). What comes of it is where a fit of simulations begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.disturbance_smoother import POSITIONS, SPEEDS, latent
from firmloop.diagnose.model.hypothesis import PHASE, LibraryTerm, Point, Problem, entered, first_point, waved
from firmloop.diagnose.policy import LEADS, MOST_EFFECTS, STANDSTILL
from firmloop.identify.plants.attach import site_of
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import constants_of, course_of

Array = NDArray[np.float64]

_MOVING = ("torque", "force")


class Regressor(NamedTuple):
    """A term, where its grid begins, and where in a table its columns are: one, or two of a wave."""

    term: LibraryTerm
    start: Mapping[str, float]
    places: tuple[int, ...]

    def denied(self, factor: float) -> bool:
        """Tell whether a factor makes of the law one that physics does not allow."""
        low = self.term.parameters[0].low
        return len(self.places) == 1 and not low <= factor * self.start[self.term.keys[0]]

    def sized(self, factors: Array) -> Mapping[str, float]:
        """Return the start times a factor, or of a wave times that and the one of its quadrature."""
        if len(self.places) > 1:
            return waved(self.term, self.start, factors)
        return {key: float(factors[0]) * value for key, value in self.start.items()}


class Motion(NamedTuple):
    """Rows (n,) of a recording: speed, position, what the drive gives, and acceleration - the nominal plant's.

    `tangents` (n, k) are the slopes of that for free parameters, in units of their values.
    """

    speed: Array
    position: Array
    load: Array
    missing: Array
    tangents: Array


@dataclass(frozen=True, slots=True)
class Regression:
    """Products of all columns (c, c): `free` tangents of the nominal rate, those of the laws, and what is missing."""

    laws: tuple[Regressor, ...]
    products: Array
    free: int
    rows: int

    def left(self, laws: Sequence[Regressor]) -> tuple[float, Array]:
        """Return -2 log likelihood + BIC penalty of some laws beside the tangents, and the factors of all columns.

        Infinite where a factor is one that physics does not allow.
        """
        chosen = [*range(self.free), *(place for law in laws for place in law.places)]
        sizes = np.sqrt(np.maximum(np.diag(self.products)[chosen], 1e-300))
        square = self.products[np.ix_(chosen, chosen)] / np.outer(sizes, sizes)
        factors = np.linalg.lstsq(square, self.products[chosen, -1] / sizes, rcond=1e-10)[0] / sizes
        if any(law.denied(float(factors[chosen.index(law.places[0])])) for law in laws):
            return math.inf, factors
        rest = max(float(self.products[-1, -1] - self.products[chosen, -1] @ factors), 1e-300)
        unknowns = sum(len(law.term.keys) for law in laws)
        return self.rows * math.log(rest) + unknowns * math.log(self.rows), factors

    def led(self) -> list[tuple[Regressor, ...]]:
        """Return the laws of one, two and more terms that leave least, a few of each: beside others another is best."""
        beams: list[tuple[Regressor, ...]] = [()]
        found: list[tuple[Regressor, ...]] = []
        least = self.left(())[0]
        for _ in range(MOST_EFFECTS):
            more = {
                frozenset(each.term.label for each in (*beam, law)): (*beam, law)
                for beam in beams
                for law in self.laws
                if law not in beam
            }
            told = sorted(((self.left(laws)[0], laws) for laws in more.values()), key=lambda pair: pair[0])[:LEADS]
            if not told or not told[0][0] < least:
                break
            least, beams = told[0][0], [laws for score, laws in told if math.isfinite(score)]
            found += beams
        return found


def leads(problem: Problem, noise: Sequence[float]) -> tuple[tuple[tuple[LibraryTerm, ...], Point], ...]:
    """Return hypotheses, each with where a fit of it begins; none where no motion was recorded.

    None either where recordings have values of their own, which no balance in common holds. `noise` (r,) is the rms of
    each output.
    """
    told = {signal.name for signal in problem.plant.outputs}
    balance = next((each for each in problem.plant.balances if each.kind in _MOVING and each.state >= 0), None)
    if balance is None or balance.effort is None or problem.plant.varying or not told & {*SPEEDS, *POSITIONS}:
        return ()
    at = tuple(ca.SX.sym(f"p{k}", problem.plant.rate.numel_in(k)) for k in range(3))
    rate = problem.plant.rate(*at)[balance.state]
    rates = ca.Function("rates", at, [ca.vertcat(balance.effort(*at), rate, ca.jacobian(rate, at[2]).T)])
    parts = [_motion(problem, balance, rates, recording, noise) for recording in problem.train]
    whole = [each for each in parts if each is not None]
    if len(whole) < len(parts):
        return ()
    motion = Motion(*map(np.concatenate, zip(*whole, strict=True)))
    made = _regression(problem, balance, motion, bool(told & {*POSITIONS}))
    return tuple(_begun(problem, balance, made, laws) for laws in made.led())


def _motion(
    problem: Problem, balance: Balance, rates: ca.Function, recording: Recording, noise: Sequence[float]
) -> Motion | None:
    """Return the rows of a recording; None where nothing can be smoothed.

    `rates` of (x, u, p) are what the drive gives, the nominal acceleration, and its slopes for all parameters.
    """
    plant = problem.plant
    seen = latent(plant, recording, noise)
    if seen is None:
        return None
    constants, free = _nominal(plant)
    x, drive = seen.states, course_of(plant, recording).drive[: len(seen.time)]
    told = rates.map(len(x))(x.T, drive.T, np.tile(constants[:, None], len(x)))
    load, nominal, *slopes = np.asarray(told)
    position = x[:, balance.position] if balance.position >= 0 else np.zeros(len(x))
    missing = np.gradient(x[:, balance.state], seen.time) - nominal
    return Motion(x[:, balance.state], position, load, missing, np.stack(slopes, axis=1)[:, free] * constants[free])


def _nominal(plant: Plant) -> tuple[Array, list[int]]:
    """Return the values of the nominal parameters, and which of them are free."""
    count = plant.rate.numel_in(2)
    return constants_of(plant)[:count], [k for k, each in enumerate(plant.parameters[:count]) if each.free]


def _regression(problem: Problem, balance: Balance, motion: Motion, placed: bool) -> Regression:
    """Tabulate the rows in motion; `placed`: whether the position was recorded, so that laws of it can be tried."""
    plant, (constants, free) = problem.plant, _nominal(problem.plant)
    moving = np.abs(motion.speed) > STANDSTILL * np.sqrt(np.mean(motion.speed**2))
    w, th, load = (ca.DM(each[moving]) for each in (motion.speed, motion.position, motion.load))
    columns, laws, count = [motion.tangents[moving]], list[Regressor](), len(free)
    for term in problem.terms:
        effect, starts = term.effect, problem.starts[term.label]
        waves = any(key.endswith(PHASE) for key in term.keys)
        if effect.holding is None or effect.place != "torque" or not starts or len(term.keys) > 1 + waves:
            continue  # it is no size times a shape
        site = site_of(plant, effect, term.output, term.at)
        if plant.balances[site.balance] is not balance or (effect.needs_position and not placed):
            continue
        for turned in (0.0, 0.5 * math.pi)[: 1 + waves]:
            held = effect.holding(site, tuple(starts[0][key] + turned * key.endswith(PHASE) for key in term.keys))
            moved = held.effort(w, ca.sign(w), th) - held.share * ca.fabs(load) * ca.sign(w)
            columns.append(float(balance.per(constants)) * np.asarray(moved))
        laws.append(Regressor(term, starts[0], tuple(range(count, count + 1 + waves))))
        count += 1 + waves
    tall = np.concatenate([*columns, motion.missing[moving][:, None]], axis=1)
    return Regression(tuple(laws), tall.T @ tall, len(free), len(tall))


def _begun(
    problem: Problem, balance: Balance, made: Regression, laws: Sequence[Regressor]
) -> tuple[tuple[LibraryTerm, ...], Point]:
    """Return the terms of some laws, and the point that the regression makes of them and the plant as given."""
    plant, (_, factors), begin = problem.plant, made.left(laws), first_point(problem, problem.train)
    before, free = _nominal(plant)
    now = before.copy()
    now[free] *= np.exp(np.clip(factors[: made.free], -1.0, 1.0))
    values = {**begin.values, **{plant.parameters[k].name: float(now[k]) for k in free}}
    ratio, place = float(balance.per(before)) / float(balance.per(now)), made.free
    for law in laws:
        own = ratio * factors[place : place + len(law.places)]
        place += len(own)
        values = dict(entered(values, law.term, law.sized(own)))
    return tuple(law.term for law in laws), Point(values, begin.starts)
