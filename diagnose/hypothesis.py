"""A Hypothesis: the nominal plant with some effects switched on, and the unknowns that follow from it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.direct import DIRECT, Direct
from firmloop.diagnose.wrap import unwrapped
from firmloop.identify.plants.attach import all_uses, label_of, parameters_of, site_of
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import measured, rest_start
from firmloop.identify.simulation.superset import Superset, inertia_parameter, scales_of, superset

Array = NDArray[np.float64]

MOMENT = ".time_s"  # how the full name of a moment ends
_COARSE = 1.0  # as longest change: several times as fast as the usual, and alters an effect's trace by < 1/1000
_STEP = 1e-5  # of a coordinate, for difference quotients
_FINE_STEP = 1e-8  # the same where waves follow the simulated angle, which it takes far after many turns
_ROUGH_STEP = 3e-3  # the same where bodies meet: each time they meet a moment later, outputs move by a small leap
_LEAST = 0.1  # of the nominal inertia, which stays where a load is split off


@dataclass(frozen=True, slots=True)
class Cause:
    """One effect at one place: `output` is that of a sensor effect or the state of a flow effect, else None."""

    effect: Effect
    output: str | None
    parameters: tuple[EffectParameter, ...]
    keys: tuple[str, ...]  # full names of the parameters in the superset
    taken: tuple[str, str] | None  # a second inertia, and the nominal parameter that held it before
    scales: Scales  # sizes in the recordings, where the cause acts

    @property
    def label(self) -> str:
        """Name that tells the place too."""
        return self.effect.name if self.output is None else f"{self.effect.name} of {self.output}"


def _starts(plant: Plant, cause: Cause) -> tuple[Mapping[str, float], ...]:
    """Return the effect's own grid."""
    grid = cause.effect.starts(site_of(plant, cause.effect, cause.output), cause.scales)
    return tuple(dict(zip(cause.keys, values, strict=True)) for values in grid)


@dataclass(frozen=True, slots=True)
class Scene:
    """A plant with its superset simulator, and the recordings it is held against."""

    plant: Plant
    engine: Superset
    train: tuple[Recording, ...]
    test: tuple[Recording, ...]
    causes: tuple[Cause, ...]
    starts: Mapping[str, tuple[Mapping[str, float], ...]]  # by Cause.label: points a fit begins from
    floors: Array  # (r,) smallest noise rms the resolution of each output allows
    memory: dict[tuple[object, ...], Array]  # what an initial state does to the outputs, see refit.start_slopes
    direct: tuple[Direct, ...]  # read off before any fit; the recordings are without them

    def cause(self, name: str) -> Cause | None:
        """Return the first cause of that effect."""
        return next((cause for cause in self.causes if cause.effect.name == name), None)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One unknown: a parameter by its full name, as its logarithm where it spans decades, in units of `scale`.

    `step` is by how much of it a difference quotient moves it.
    """

    name: str
    logarithmic: bool
    low: float
    high: float
    scale: float
    step: float

    def inner(self, value: float) -> float:
        """Return the coordinate of a value."""
        return math.log(max(value, 1e-300)) if self.logarithmic else value / self.scale

    def outer(self, inner: float) -> float:
        """Return the value of a coordinate, inside its bounds."""
        value = math.exp(min(max(inner, -600.0), 600.0)) if self.logarithmic else inner * self.scale
        return min(max(value, self.low), self.high)

    def gradient(self, value: float) -> float:
        """Return d value / d coordinate."""
        return value if self.logarithmic else self.scale


@dataclass(frozen=True, slots=True)
class Point:
    """Values of all parameters that are not neutral, and the initial state of every recording."""

    values: Mapping[str, float]
    starts: tuple[Array, ...]


def make_scene(plant: Plant, train: Sequence[Recording], test: Sequence[Recording], floors: Array) -> Scene:
    """List every cause the plant can have, and where a fit of each begins."""
    train, test, direct = unwrapped(plant, train, test)
    engine = superset(plant)
    engine.hasten(_COARSE)
    engine.follow(True)
    sizes = cache(partial(scales_of, plant, train))
    causes = []
    for use in all_uses(plant):
        effect = find_effect(use.name)
        if effect.seen_by in DIRECT:
            continue
        site = site_of(plant, effect, use.output)
        scales = sizes(site.output, site.balance)
        if effect.possible is not None and not effect.possible(scales):
            continue
        parameters = tuple(_bounded(effect, each, scales) for each in parameters_of(plant, use.name, use.output))
        label = label_of(plant, use)
        keys = tuple(f"{label}.{each.name}" for each in parameters)
        load = next((key for key, each in zip(keys, parameters, strict=True) if each.name == site.load), None)
        held = None if load is None else inertia_parameter(plant, site.balance)
        taken = None if load is None or held is None else (load, held)
        causes.append(Cause(effect, use.output, parameters, keys, taken, scales))
    causes.sort(key=lambda cause: cause.label)  # nothing may depend on the order of lines in a project
    starts = {cause.label: _starts(plant, cause) for cause in causes}
    return Scene(plant, engine, tuple(train), tuple(test), tuple(causes), starts, floors, {}, direct)


def _bounded(effect: Effect, parameter: EffectParameter, scales: Scales) -> EffectParameter:
    """Narrow a parameter to what the recordings can tell.

    A wave along a way has one period in it at least: a longer one is a spring or a load, which have names.
    """
    if parameter.name == "periods_per_m":
        parameter = replace(parameter, low=max(parameter.low, 1.0 / scales.travel))
    return parameter if effect.bounded is None else effect.bounded(parameter, scales)


def entered(values: Mapping[str, float], cause: Cause, start: Mapping[str, float]) -> Mapping[str, float]:
    """Return the values with a cause at its start; an inertia that it adds is taken from the nominal one."""
    whole = {**values, **start}
    if cause.taken is not None:
        load, held = cause.taken
        whole[held] = max(values[held] - whole[load], _LEAST * values[held])
    return whole


def searched(cause: Cause) -> bool:
    """Tell whether a cause has a moment, which may be that of the largest of many chances."""
    return any(key.endswith(MOMENT) for key in cause.keys)


def turning(causes: Iterable[Cause]) -> bool:
    """Tell whether there are waves along an angle among the causes."""
    return any(key.endswith(".phase_rad") for cause in causes for key in cause.keys)


def meeting(causes: Iterable[Cause]) -> bool:
    """Tell whether there are bodies that meet among the causes."""
    return any(cause.effect.contact for cause in causes)


def coordinates(scene: Scene, causes: Sequence[Cause], at: Mapping[str, float]) -> tuple[Coordinate, ...]:
    """Return the unknowns of a hypothesis: the free nominal parameters, then those of its causes."""
    found = []
    step = _FINE_STEP if turning(causes) and not scene.engine.recorded else _STEP
    if meeting(causes):
        step = _ROUGH_STEP
    for parameter in scene.plant.parameters:
        if parameter.free:
            value = at.get(parameter.name, parameter.value)
            positive = parameter.low >= 0.0 and value > 0.0 and not _may_vanish(parameter.name)
            size = max(abs(parameter.value), 1e-12)
            found.append(Coordinate(parameter.name, positive, parameter.low, parameter.high, size, step))
    for cause in causes:
        for key, each in zip(cause.keys, cause.parameters, strict=True):
            size = max((abs(start[key]) for start in scene.starts[cause.label] if key in start), default=1.0)
            found.append(Coordinate(key, each.logarithmic, each.low, each.high, size or 1.0, step))
    return tuple(found)


def _may_vanish(name: str) -> bool:
    """Viscous friction may well be nothing at all; its logarithm would run away."""
    return name.startswith("b_") or name.startswith("delay")


def first_point(scene: Scene, recordings: Sequence[Recording]) -> Point:
    """Return the nominal values as given, every recording at rest."""
    values = {parameter.name: parameter.value for parameter in scene.plant.parameters}
    return Point(values, tuple(full_start(scene, recording) for recording in recordings))


def full_start(scene: Scene, recording: Recording) -> Array:
    """Return the start at rest in the superset's states."""
    start = np.zeros(len(scene.engine.states))
    start[: len(scene.plant.states)] = rest_start(scene.plant, recording)
    return start


def outputs_of(scene: Scene, recording: Recording) -> Array:
    """Return the recorded outputs (n, r)."""
    return measured(scene.plant, recording)
