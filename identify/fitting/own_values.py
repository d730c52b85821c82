"""Tell what each recording has of what differs between them, and where the rest of a recording begins at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.covariance import uncertainty
from firmloop.identify.fitting.experiment import best_start, experiments, misfit
from firmloop.identify.fitting.least_squares import descend, triangle
from firmloop.identify.plants.plant import Parameter, Plant, Varying
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import course_of, rest_start, simulator

Array = NDArray[np.float64]

_STRETCHES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.0)  # of a recording, to which a beginning is fitted in turn
_FEWEST = 20  # rows of the first
_FINEST = 1e6  # times that an output may weigh more than before


@dataclass(frozen=True, slots=True)
class OwnValue:
    """What one recording has of a value that differs from recording to recording, by the name a project lists."""

    source: str
    parameter: Parameter


def own_values(
    plant: Plant,
    sources: Sequence[str],
    starts: Array,
    residuals: Sequence[Array],
    slopes: Sequence[Array],
    shared: int,
) -> tuple[OwnValue, ...]:
    """Return the values of all recordings, recording after recording.

    `starts` (w, n) are their initial states, `residuals` (q, r) what a fit leaves in units of the noise, `slopes`
    (q, r, k + n) those for the `shared` parameters and for the initial state. The doubt of the shared ones is in the
    intervals.
    """
    places = [shared + one.state for one in plant.varying]
    if not places:
        return ()
    count, blocks = len(places), []
    for k, block in enumerate(slopes):
        own = np.zeros((*block.shape[:2], count * len(slopes)))
        own[..., count * k : count * (k + 1)] = block[..., places]
        rest = [index for index in range(shared, block.shape[2]) if index not in places]
        blocks.append(np.concatenate([block[..., :shared], own, block[..., rest]], axis=2))
    found = uncertainty([1] * len(slopes), residuals, blocks, np.zeros(shared + count * len(slopes)))
    deviations = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    deviations[list(found.blind)] = math.nan
    return tuple(
        OwnValue(source, own_value(plant, one, start, float(deviations[shared + count * index + k])))
        for index, (source, start) in enumerate(zip(sources, starts, strict=True))
        for k, one in enumerate(plant.varying)
    )


def own_value(plant: Plant, one: Varying, start: Array, deviation: float) -> Parameter:
    """Return what the recording that begins there has of a value; `deviation` is that of its state."""
    common = next(p for p in plant.parameters if p.name == one.parameter)
    value = one.at(common.value, float(start[one.state]))
    size = deviation * (abs(value) if one.factor else 1.0)
    return replace(common, name=one.name, value=value, deviation=size if math.isfinite(size) else None)


def by_itself(plant: Plant, recording: Recording) -> bool:
    """Tell whether no input ever changes, so that what moves moves by itself: a decay, or a constant speed."""
    return not np.any(np.ptp(course_of(plant, recording).drive, axis=0))


def own_start(plant: Plant, recording: Recording, constants: Array) -> Array:
    """Return the initial state (n,) at rest, with what the recording has of its own; its readings tell that alone.

    Where no input ever changes, what moves moves by itself: a decay begins where its readings say.
    """
    start = rest_start(plant, recording)
    states = [one.state for one in plant.varying]
    coasts = by_itself(plant, recording)
    names = {signal.name for signal in plant.outputs}
    if not (states or coasts) or not names <= set(recording.columns):
        return start
    (made,) = experiments(plant, recording, NONE)
    engine, spread = simulator(plant, recording.hold), np.std(made.target, axis=0)
    weights = 1.0 / np.where(spread > 0.0, spread, 1.0)
    if coasts:
        return _where_it_began(plant, recording, constants, start)

    def with_own(own: Array) -> Array:
        moved = start.copy()
        moved[states] = own
        return moved

    def reduced_at(own: Array) -> Array | None:
        residual, slopes = misfit(made, engine, constants, with_own(own), ())
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
            return None
        tall = (slopes[..., states] * weights[:, None]).reshape(-1, len(states))
        return triangle(tall, (residual * weights).reshape(-1, 1))

    return with_own(descend(reduced_at, start[states])[1])


def _where_it_began(plant: Plant, recording: Recording, constants: Array, start: Array) -> Array:
    """Fit the initial state (n,) of a machine that coasts, outputs weighed by what is left of each.

    At first to a short stretch: a small error of a speed is many turns at the end, and a turn off is a trap.
    """
    rows, engine = len(recording.time), simulator(plant, recording.hold)
    weights = None
    for share in _STRETCHES:
        (made,) = experiments(plant, recording.part(0, max(int(share * rows), min(rows, _FEWEST))), NONE)
        if weights is None:
            weights = 1.0 / np.maximum(np.std(made.target, axis=0), 1e-300)
        start = best_start(made, engine, constants, start, weights)
        left = np.sqrt(np.mean(misfit(made, engine, constants, start, ())[0] ** 2, axis=0))
        if np.all(np.isfinite(left)):
            weights = np.minimum(1.0 / np.maximum(left, 1e-300), _FINEST * weights)
    return start
