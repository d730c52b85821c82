"""List the nameless terms a mismatch may be tested for: what follows which coordinate, in a balance or in a reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.discrepancy.coordinates import Carried, Coordinate, Curve, Springs, Warmth, Wave, interrupted
from firmloop.diagnose.model.disturbance_smoother import POSITIONS, SPEEDS, Latent
from firmloop.diagnose.policy import (
    DRIFT_CYCLES,
    FAR_TO_ONE_SIDE,
    GRID_HZ,
    LINES_PER_CYCLE,
    MAINS_HZ,
    NEIGHBOUR_CYCLES,
    ROWS_OF_A_CYCLE,
)
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.linear_filter import recurred
from firmloop.identify.simulation.linear_response import disturbed
from firmloop.identify.simulation.linearize import Linear, linearize
from firmloop.identify.simulation.simulate import course_of
from firmloop.identify.simulation.superset import travelled

Array = NDArray[np.float64]

SENSOR = "sensor"
_TURNING = " (per turn)"


@dataclass(frozen=True, slots=True)
class NamelessTerm:
    """A nameless term: `place` is the number of its balance, or of its output for a reading."""

    kind: str
    place: int
    coordinate: Coordinate

    def moved(self, plant: Plant, recording: Recording, index: int) -> Array:
        """Return what its unknowns do to the outputs (n, r, b) of the linear plant."""
        columns = self.coordinate.columns(index)
        if self.kind != SENSOR:
            return disturbed(plant, {}, recording, columns, self.place)
        found = np.zeros((len(recording.time), len(plant.outputs), columns.shape[1]))
        found[: len(columns), self.place] = columns
        return found


def nameless_terms(
    plant: Plant,
    recordings: Sequence[Recording],
    seen: Sequence[Latent],
    outputs: Sequence[Array],
    residuals: Sequence[Array],
) -> list[NamelessTerm]:
    """List the terms; `outputs` (n, r) are the simulated ones of every recording, `residuals` what they leave."""
    tables = [_coordinates(plant, recording, each) for recording, each in zip(recordings, seen, strict=True)]
    shared = [name for name in tables[0] if all(name in table for table in tables)]
    places = {name: tuple(table[name] for table in tables) for name in shared}
    turning = {name for name in shared if name.endswith(_TURNING)}
    curves = [Curve(name, values, name in turning) for name, values in places.items()]
    # What differs between two directions has few unknowns: it shows where hats are too many.
    curves += [replace(each, bent=True) for each in curves if not each.periodic and _two_sided(each)]
    position = next((each for each in curves if each.periodic or each.name in POSITIONS), None)
    speed = next((places[name] for name in SPEEDS if name in places), None)
    step = float(np.median(np.diff(seen[0].time)))
    everywhere: list[Coordinate] = [*curves]
    pitch = loudest(recordings, residuals)
    if pitch > 0.0:
        times = tuple(recording.time[: len(each.time)] for recording, each in zip(recordings, seen, strict=True))
        everywhere.append(Wave(f"time, {pitch / (2.0 * np.pi):.4g} times a second", times, pitch))
    moving = [] if speed is None else _of_motion(speed, position, step)
    drives = places[plant.inputs[0].name]
    found = []
    for place, kind in enumerate(seen[0].kinds):
        here = [*everywhere, *(moving if kind in ("torque", "force") else ())]
        fails = interrupted(plant.inputs[0].name, drives, [each.disturbances[place] for each in seen])
        found += [NamelessTerm(kind, place, each) for each in ([*here, fails] if fails is not None else here)]
    for place, signal in enumerate(plant.outputs):
        own = tuple(each[:, place] for each in outputs)
        found.append(NamelessTerm(SENSOR, place, Curve(signal.name, own)))
    return found


def _of_motion(speed: tuple[Array, ...], position: Curve | None, step: float) -> list[Coordinate]:
    """List what a term of a balance of torques or forces could follow, but for curves: its way, its place, its heat.

    By the simulated speed: the noise of a measured one would correlate with what is left.
    """
    ways = tuple(np.cumsum(each) * step for each in speed)
    found: list[Coordinate] = [Springs("travel since reversals", ways, step, False)]
    found += [Springs("travel of late", ways, step, True), Warmth("speed, by its heat of late", speed, step)]
    if position is not None:
        name, places, turns = position.name, position.values, position.periodic
        found.append(Curve(f"speed, by {name}", places, turns, factor=speed))
        found.append(Carried(f"acceleration, by {name}", places, turns, speeds=speed, step=step))
    return found


def _two_sided(coordinate: Curve) -> bool:
    """Tell whether a coordinate goes far to both sides of zero."""
    low, high = np.quantile(np.concatenate(coordinate.values), [FAR_TO_ONE_SIDE, 1.0 - FAR_TO_ONE_SIDE])
    return bool(low < 0.0 < high and min(-low, high) > FAR_TO_ONE_SIDE * max(-low, high))


def loudest(recordings: Sequence[Recording], residuals: Sequence[Array]) -> float:
    """Return the pitch (rad/s) of the line that stands out most from its neighbours in all spectra; 0 where none.

    Readings that alternate, as those of a counter do, are no wave: a cycle has several rows.
    """
    shortest = min(len(each) for each in residuals)
    step = float(np.median(np.diff(recordings[0].time)))
    rows = LINES_PER_CYCLE * shortest
    total = np.zeros(rows // 2 + 1)
    for left in residuals:
        power = np.abs(np.fft.rfft(left[:shortest] * np.hanning(shortest)[:, None], rows, axis=0)) ** 2
        around = scipy.ndimage.median_filter(power, (LINES_PER_CYCLE * NEIGHBOUR_CYCLES, 1), mode="nearest")
        total += np.sum(power / np.maximum(around, 1e-300), axis=1)
    total[: LINES_PER_CYCLE * DRIFT_CYCLES] = total[int(rows / ROWS_OF_A_CYCLE) :] = 0.0
    total[_hum(np.fft.rfftfreq(rows, step), 1.0 / step, 1.0 / (shortest * step))] = 0.0
    return float(2.0 * np.pi * np.argmax(total) / (rows * step)) if np.any(total) else 0.0


def _hum(lines: NDArray[np.floating], rate: float, width: float) -> NDArray[np.bool_]:
    """Tell which lines (Hz) may be mains hum read at a rate, `width` that of a line: noise, whatever it moves.

    Where the rate is too low, the hum is seen at its mirror image.
    """
    seen = [abs(each - rate * round(each / rate)) for each in MAINS_HZ]
    return np.asarray(np.any([abs(lines - each) < GRID_HZ + width for each in seen], axis=0))


def _coordinates(plant: Plant, recording: Recording, seen: Latent) -> Mapping[str, Array]:
    """Return coordinates a term could follow, (n,) by name.

    Speeds and currents are simulated, not measured: the noise of a measured one would correlate with what is left.
    A simulated position that nothing pulls back drifts, so that is smoothed.
    """
    rows = len(seen.time)
    bare = linearize(plant)
    moved = _simulated_states(plant, bare, recording)[:rows]
    table: dict[str, Array] = {}
    for index, signal in enumerate(plant.states):
        drifts = signal.name in POSITIONS and not np.any(bare.a[:, index])
        values = seen.states[:, index] if drifts else moved[:, index]
        table[f"{signal.name}{_TURNING}" if signal.name == "position_rad" else signal.name] = values
    known = {signal.name for signal in plant.states}
    for name, unit, told in (("position_rad", "rad", f"angle{_TURNING}"), ("position_m", "m", "position_m")):
        way = None if name in known else travelled(recording, unit)
        if way is not None:
            table[told] = way[:rows]
    table[plant.inputs[0].name] = course_of(plant, recording).drive[:rows, 0]
    return table


def _simulated_states(plant: Plant, bare: Linear, recording: Recording) -> Array:
    """Return the states (n, s) of the linear plant from rest."""
    course = course_of(plant, recording)
    states, inputs = bare.b.shape
    whole = np.zeros((states + inputs, states + inputs))
    whole[:states, :states], whole[:states, states:] = bare.a, bare.b
    moved = scipy.linalg.expm(whole * course.step)
    step, pushed = moved[:states, :states], course.drive @ moved[:states, states:].T
    return recurred(step, pushed[:-1], np.zeros(states))
