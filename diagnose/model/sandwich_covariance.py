"""Ask what a disturbance that pushes the machine, and not its readings, leaves of every parameter.

Noise models add to outputs, everywhere alike. A slow force does not: what it has moved before a stop is met moves that
moment, and pressed against the stop it moves nothing. Deviations that count on the one are far too small for the other.
Pushes of batches of the recording, as large as what is left of it tells, are taken through the fit to first order: the
sandwich of Huber (Proc. 5th Berkeley Symposium 1 (1967) 221-233) with a filling that follows the machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.model.disturbed_plant import sensors_remember
from firmloop.diagnose.model.fit import Fitted, inverse, squares_of, strength, widened
from firmloop.diagnose.model.hypothesis import LibraryTerm, Problem, searched
from firmloop.diagnose.model.slopes import start_slopes, whitened
from firmloop.diagnose.policy import (
    CERTAIN_SIZE,
    CERTAIN_STEP,
    KNOWN_BEFOREHAND,
    PUSH_SHARE,
    PUSHED_BATCHES,
    ROUNDED_MOVE,
)
from firmloop.identify.fitting.noise import Noise, colored, flat
from firmloop.identify.plants.effects import effect_seen_by
from firmloop.identify.recordings.recording import Recording

Array = NDArray[np.float64]


class Sizes(NamedTuple):
    """How large moves (b,) are, what one of each does that no other does, in units of noise, and the share left."""

    sizes: Array
    alone: Array
    left: float


def pushed(problem: Problem, fitted: Fitted, index: int, begins: Array) -> Array | None:
    """Return what a load of one in each batch alone does to the outputs (n, r, batches); None where nothing loads."""
    probe = problem.term(effect_seen_by("moment").name)
    if probe is None:
        return None
    recording, start = problem.train[index], fitted.point.starts[index]
    push, moment = probe.keys
    size = PUSH_SHARE * probe.scales.effort
    values = {key: value for key, value in fitted.point.values.items() if key not in probe.keys}
    without = problem.engine.simulate(recording, values, start)
    steps = [
        (problem.engine.simulate(recording, {**values, push: size, moment: float(begin)}, start) - without) / size
        for begin in begins
    ]
    steps.append(np.zeros_like(without))
    return np.nan_to_num(np.stack([one - other for one, other in pairwise(steps)], axis=2))


def batches(recording: Recording, count: int) -> Array:
    """Return when the batches (count,) of a recording begin."""
    return np.linspace(recording.time[0], recording.time[-1], count + 1)[:-1]


def sizes_of(
    problem: Problem, fitted: Fitted, noises: Sequence[Noise], index: int, moves: Array, seen: Iterable[Array]
) -> list[Sizes]:
    """Return for each of `seen` (n, r) how large the moves (n, r, batches) in it are, and the share they leave.

    Moves of which rounding is all there is, as of a push on a shaft that friction holds, are left out.
    """
    sizes = flat(noises)
    lengths = np.linalg.norm(whitened(moves, sizes), axis=0)
    told = lengths > ROUNDED_MOVE * np.max(lengths)
    if np.sum(told) > 1:
        moves = moves[..., told]
    own = np.nan_to_num(start_slopes(problem, problem.train[index], fitted.point, index, exact=True))
    tall = whitened(np.concatenate([moves, own], axis=2), sizes)
    scale = np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
    inverted = np.linalg.pinv(tall / scale, rcond=1e-9)
    count = moves.shape[2]
    alone = scale[:count] / np.linalg.norm(inverted[:count], axis=1)
    found = []
    for each in seen:
        goal = whitened(each, sizes)
        answer = (inverted @ goal) / scale
        rest, whole = float(np.linalg.norm(goal - tall @ answer)), float(np.linalg.norm(goal))
        found.append(Sizes(answer[:count], alone, rest / whole if whole > 0.0 else 0.0))
    return found


def doubtful(fitted: Fitted, noises: Sequence[Noise]) -> LibraryTerm | None:
    """Return the term that is least more than what a slow disturbance makes of nothing; None where all are."""
    if not colored(noises) or not fitted.terms:
        return None
    times = {term: strength(fitted, term) / (CERTAIN_STEP if searched(term) else CERTAIN_SIZE) for term in fitted.terms}
    least = min(times, key=lambda term: times[term])
    return least if times[least] < 1.0 else None


def with_pushes(problem: Problem, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Widen deviations to what pushes leave of them, where noises have a memory that is likelier the machine's."""
    unknowns = fitted.coordinates
    if not colored(noises) or not unknowns or sensors_remember(problem, fitted.point.values, fitted.residuals):
        return fitted
    squares = squares_of(problem, fitted, fitted.noises)
    place = squares.at(fitted.point)
    if not place.finite:
        return fitted
    found, pulled = [], []
    for index, slopes in enumerate(squares.slopes(place)):
        moves = pushed(problem, fitted, index, batches(problem.train[index], PUSHED_BATCHES))
        if moves is None:
            return fitted
        found.append(sizes_of(problem, fitted, noises, index, moves, (place.residuals[index],))[0])
        pulled.append(squares.spread_out(index, slopes.T @ whitened(moves, fitted.noises)))
    covariance = inverse(fitted.normal)
    answer = (answering(fitted.normal, squares.tether) @ np.concatenate(pulled, axis=1))[: len(unknowns)]
    moved = np.linalg.norm(answer, axis=1) * _usual(found)
    told = np.sqrt(np.maximum(np.diag(covariance)[: len(unknowns)], 0.0))
    factors = np.where(told > 0.0, moved / np.where(told > 0.0, told, 1.0), 1.0)
    return widened(fitted, factors)


def _usual(found: Sequence[Sizes]) -> float:
    """Return the standard deviation of pushes: each counts as far as it is told from others.

    What pushes a shaft whose sensor is at its limit shows little, and of all such the same: what is left when it ends.
    """
    sizes, weights = (np.concatenate(each) for each in zip(*((one.sizes, one.alone**2) for one in found), strict=True))
    mean = np.average(sizes, weights=weights)
    return float(np.sqrt(np.average((sizes - mean) ** 2, weights=weights)))


def answering(normal: Array, tether: Array) -> Array:
    """Return the covariance of the combinations that recordings tell more of than was known before them.

    The others cannot follow a push: what slopes by differences have of them is rounding. `tether` are the rows
    [weights, aim] of what was known, in `normal` already.
    """
    sizes = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, axes = np.linalg.eigh(normal / np.outer(sizes, sizes))
    live = values > 1e-12 * values[-1]
    half = axes[:, live] / np.sqrt(values[live]) / sizes[:, None]
    before = tether[:, :-1] @ half[: tether.shape[1] - 1]
    known, turned = np.linalg.eigh(before.T @ before)
    told = half @ turned[:, known < KNOWN_BEFOREHAND]
    return np.asarray(told @ told.T)
