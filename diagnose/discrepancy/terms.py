"""List the nameless terms a mismatch may be tested for: what follows which coordinate, in a balance or in a reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.diagnose.model.disturbance_smoother import POSITIONS, SPEEDS, Latent
from firmloop.diagnose.policy import (
    DRIFT_CYCLES,
    FAR_TO_ONE_SIDE,
    GRID_HZ,
    HARMONICS,
    HATS,
    LINES_PER_CYCLE,
    MAINS_HZ,
    NEIGHBOUR_CYCLES,
    ROWS_OF_A_CYCLE,
    SPRING_MEMORIES_S,
)
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.linear_filter import filtered, recurred
from firmloop.identify.simulation.linear_response import disturbed
from firmloop.identify.simulation.linearize import Linear, linearize
from firmloop.identify.simulation.simulate import course_of
from firmloop.identify.simulation.superset import travelled

Array = NDArray[np.float64]

SENSOR = "sensor"
_TURNING = " (per turn)"


@dataclass(frozen=True, slots=True)
class Covariate:
    """What a term could follow, (n,) of every recording; `factor` multiplies the term."""

    name: str
    periodic: bool
    values: tuple[Array, ...]
    factor: tuple[Array, ...] | None = None
    step: float = 0.0  # s from row to row, where the term remembers its way: springs that yield or relax
    relaxes: bool = False
    pitch: float = 0.0  # rad/s of a wave over time, which every recording has of its own size and phase
    bent: bool = False  # straight on either side of zero

    @property
    def memory(self) -> bool:
        """Tell whether the term is no function of where its coordinate is, but of how it came there."""
        return self.step > 0.0

    @property
    def level(self) -> bool:
        """Tell whether a constant is one of its shapes."""
        return not (self.periodic or self.memory or self.pitch or self.factor)

    def columns(self, index: int) -> Array:
        """Return hats, waves or springs (n, b) of one recording."""
        values = self.values[index]
        if self.pitch:
            return np.stack([np.sin(self.pitch * values), np.cos(self.pitch * values)], axis=1)
        if self.memory:
            return _relaxing(values, self.step) if self.relaxes else _yielding(values, self._reaches())
        found = self.shapes(values)
        return found if self.factor is None else found * self.factor[index][:, None]

    def shapes(self, at: Array) -> Array:
        """Return hats or waves (n, b) at `at` (n,)."""
        if self.periodic:
            waves = [wave(order * at) for order in range(1, HARMONICS + 1) for wave in (np.sin, np.cos)]
            return np.stack(waves, axis=1)
        knots = self.centres()
        return np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=1)

    def centres(self) -> Array:
        """Return where the shape is drawn: the tops of the hats, or points around a turn."""
        if self.periodic:
            return np.linspace(0.0, 2.0 * np.pi, 25)
        if self.bent:
            every = np.concatenate(self.values)
            return np.array([every.min(), 0.0, every.max()])
        return np.unique(np.quantile(np.concatenate(self.values), np.linspace(0.0, 1.0, HATS)))

    def _reaches(self) -> Array:
        steps = np.concatenate([np.diff(values) for values in self.values])
        return float(np.sqrt(np.mean(steps**2))) / self.step * np.array(SPRING_MEMORIES_S)


@dataclass(frozen=True, slots=True)
class NamelessTerm:
    """A nameless term: `place` is the number of its balance, or of its output for a reading."""

    kind: str
    place: int
    coordinate: Covariate

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
    plain = [Covariate(name, name in turning, values) for name, values in places.items()]
    # What differs between two directions has few unknowns: it shows where hats are too many.
    plain += [replace(each, bent=True) for each in plain if not each.periodic and _two_sided(each)]
    position = next((each for each in plain if each.periodic or each.name in POSITIONS), None)
    speed = next((places[name] for name in SPEEDS if name in places), None)
    pitch = loudest(recordings, residuals)
    if pitch > 0.0:
        times = tuple(recording.time[: len(each.time)] for recording, each in zip(recordings, seen, strict=True))
        plain.append(Covariate(f"time, {pitch / (2.0 * np.pi):.4g} times a second", False, times, pitch=pitch))
    found = []
    for place, kind in enumerate(seen[0].kinds):
        found += [NamelessTerm(kind, place, each) for each in plain]
        if kind in ("torque", "force") and speed is not None:
            # By the simulated speed: the noise of a measured one would correlate with what is left.
            step = float(np.median(np.diff(seen[0].time)))
            ways = tuple(np.cumsum(each) * step for each in speed)
            for relaxes, said in ((False, "since reversals"), (True, "of late")):
                found.append(NamelessTerm(kind, place, Covariate(f"travel {said}", False, ways, None, step, relaxes)))
        if kind in ("torque", "force") and position is not None and speed is not None:
            name = f"speed, by {position.name}"
            found.append(NamelessTerm(kind, place, Covariate(name, position.periodic, position.values, speed)))
    for place, signal in enumerate(plant.outputs):
        own = tuple(each[:, place] for each in outputs)
        found.append(NamelessTerm(SENSOR, place, Covariate(signal.name, False, own)))
    return found


def _two_sided(coordinate: Covariate) -> bool:
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


def _yielding(travel: Array, reaches: Array) -> Array:
    """Return how far springs of several reaches are stretched (n, b): each yields at its own (a stop operator)."""
    found = np.zeros((len(travel), len(reaches)))
    steps = np.diff(travel, prepend=travel[0])
    stretched = np.zeros(len(reaches))
    for row, step in enumerate(steps):
        stretched = np.minimum(np.maximum(stretched + step, -reaches), reaches)
        found[row] = stretched
    return found


def _relaxing(travel: Array, step: float) -> Array:
    """Return how far springs behind dampers are stretched (n, b): each forgets its way over a time (Maxwell's)."""
    steps = np.diff(travel, prepend=travel[0])
    return np.stack(
        [filtered(np.ones(1), np.array([1.0, -np.exp(-step / time)]), steps) for time in SPRING_MEMORIES_S], axis=1
    )
