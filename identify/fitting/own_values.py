"""Tell what each recording has of what differs between them, and where it begins: at rest, or as its readings say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.covariance import Doubt, uncertainty
from firmloop.identify.fitting.experiment import Experiment, best_start, experiments, misfit, missed
from firmloop.identify.fitting.least_squares import descend, triangle
from firmloop.identify.fitting.scores import RecordingScore
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.plant import Parameter, Plant, Varying
from firmloop.identify.recordings.conditioning import NONE, Conditioning
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.at_rest import switched_on
from firmloop.identify.simulation.course import Engine
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import constants_of, drive_of, measured, rest_start, seen_places, simulator

Array = NDArray[np.float64]

_BEGINNING = 100  # a hundredth of a recording tells how fast it begins,
_FEWEST = 5  # and no fewer rows
_WEIGHINGS = 4  # of outputs by what is left of them, and where it begins by those weights, in turns
_ROUNDING = 1e-9  # of a reading's spread: noise below it is rounding


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
    doubt: Doubt = uncertainty,
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
    found = doubt([1] * len(slopes), residuals, blocks, np.zeros(shared + count * len(slopes)))
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
    """Tell whether no input ever changes or is switched on, so that what moves moves by itself: a decay, or a speed."""
    return not np.any(np.ptp(drive_of(plant, recording), axis=0)) and not switched_on(plant, recording)


def steps_apart(plant: Plant, recordings: Sequence[Recording]) -> tuple[bool, ...]:
    """Tell which recordings are steps that begin with them: their inputs stand, at another level than in others."""
    drives = [drive_of(plant, each) for each in recordings]
    stand = [not np.any(np.ptp(each, axis=0)) for each in drives]
    apart = len(np.unique([each[0] for each, stands in zip(drives, stand, strict=True) if stands], axis=0)) > 1
    return tuple(apart and stands for stands in stand)


def usual_start(plant: Plant, recording: Recording) -> Array:
    """Return the initial state (n,) at rest; of what moves by itself as its own readings begin.

    From rest, a search for that may end in another turn. A state that is read begins there, one that is the
    rate of such a state as quickly as its readings begin to move. What effects bring of their own begins with them.
    """
    found = rest_start(plant, recording)
    if not by_itself(plant, recording):
        return found
    line, few = linearize(with_effects(plant, ())), max(len(recording.time) // _BEGINNING, _FEWEST)
    read = {int(np.argmax(row)): k for k, row in enumerate(line.c) if _picks_one(row)}
    columns = {state: recording.columns.get(plant.outputs[k].name) for state, k in read.items()}
    for index in range(len(line.a)):
        reading = columns.get(index)
        begins = next((columns.get(k) for k in read if _picks_one(line.a[k]) and line.a[k, index]), None)
        if reading is not None:
            found[index] = reading[0]
        elif begins is not None:
            found[index] = np.polyfit(recording.time[:few], begins[:few], 1)[0]
    return found


def _picks_one(row: Array) -> bool:
    """Tell whether a row takes one state as it is."""
    return np.count_nonzero(row) == 1 and float(np.max(row)) == 1.0


def fit_start(plant: Plant, recording: Recording, constants: Array, conditioning: Conditioning) -> Array:
    """Estimate the initial state (n,) of a recording for the plant as it is, whatever the windows of `conditioning`."""
    (made,) = experiments(plant, recording, replace(conditioning, window_s=0.0))
    engine, spread = simulator(plant, recording.hold), np.std(made.target, axis=0)
    begin, weights = usual_start(plant, recording), 1.0 / np.where(spread > 0.0, spread, 1.0)
    found = best_start(made, engine, constants, begin, weights)
    if len(spread) == 1:
        return found
    # An output spreads far more than its noise where it goes many turns, hardly more where its sensor saturates.
    for _ in range(_WEIGHINGS):
        left, _slopes = misfit(made, engine, constants, found, ())
        sizes = np.maximum(np.sqrt(np.mean(left**2, axis=0)), _ROUNDING * spread)
        found, last = best_start(made, engine, constants, found, 1.0 / np.where(sizes > 0.0, sizes, 1.0)), found
        if np.array_equal(found, last):
            break
    return found


def own_start(plant: Plant, recording: Recording, constants: Array) -> Array:
    """Return the initial state (n,) at rest, with what the recording has of its own; its readings tell that alone.

    Where no input ever changes, what moves moves by itself: a decay begins where its readings say.
    """
    start = rest_start(plant, recording)
    if not {signal.name for signal in plant.outputs} <= set(recording.columns):
        return start
    if by_itself(plant, recording):
        return fit_start(plant, recording, constants, NONE)
    states = [one.state for one in plant.varying]
    spread = np.std(measured(plant, recording), axis=0)
    return _with_states(plant, recording, constants, start, states, 1.0 / np.where(spread > 0.0, spread, 1.0))


def placed_start(plant: Plant, recording: Recording, constants: Array) -> Array:
    """Return the initial state (n,) at rest, at the places that all their readings say, not the first of them alone.

    Of two plants that begin at one reading, the noise of that reading would tell which of them comes nearer.
    """
    start = own_start(plant, recording, constants)
    for state, column in seen_places(plant):
        shown = [float(signal.name == column) for signal in plant.outputs]
        if any(shown):
            start = _with_states(plant, recording, constants, start, [state], np.array(shown))
    return start


def _with_states(
    plant: Plant, recording: Recording, constants: Array, start: Array, states: Sequence[int], weights: Array
) -> Array:
    """Return an initial state (n,) with some of its states where the readings, by their weights (r,), say."""
    if not states:
        return start
    (made,) = experiments(plant, recording, NONE)
    engine = simulator(plant, recording.hold)

    def with_own(own: Array) -> Array:
        moved = start.copy()
        moved[states] = own
        return moved

    def cost_at(own: Array) -> float:
        return missed(made, engine, constants, with_own(own), weights)

    def reduced_at(own: Array) -> Array | None:
        residual, slopes = misfit(made, engine, constants, with_own(own), ())
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
            return None
        tall = (slopes[..., states] * weights[:, None]).reshape(-1, len(states))
        return triangle(tall, (residual * weights).reshape(-1, 1))

    return with_own(descend(cost_at, reduced_at, start[states])[1])


def unseen_own(
    plant: Plant, engine: Engine, weights: Array, parts: Sequence[Experiment], score: RecordingScore
) -> tuple[OwnValue, ...]:
    """Return what a recording that was not fitted has of its own, beside the parameters of a plant as it was found."""
    if not plant.varying:
        return ()
    residual, slopes = misfit(replace(parts[0], lags=score.lags), engine, constants_of(plant), score.starts[0], ())
    left = [residual * weights], [slopes * weights[:, None]]
    return own_values(plant, [score.source], score.starts, *left, 0)
