"""A Hypothesis: the nominal plant with some effects switched on, and the unknowns that follow from it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.data.quantization import DIRECT, Direct
from firmloop.diagnose.data.unwrap import unwrapped
from firmloop.diagnose.policy import (
    COARSE_CHANGE,
    DIFFERENCE_STEP,
    FINE_DIFFERENCE_STEP,
    LEAST_INERTIA,
    LONGEST_STEP,
    ROUGH_DIFFERENCE_STEP,
    ROUNDING,
    SLOW_NOISE,
)
from firmloop.identify.fitting.own_values import usual_start
from firmloop.identify.fitting.problem import LEASH
from firmloop.identify.fitting.starting_points import scale_and_level
from firmloop.identify.plants.attach import (
    EffectUse,
    all_uses,
    chosen_place,
    label_of,
    parameters_of,
    site_of,
    values_of,
)
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.per_recording import named_effects
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.simulate import measured
from firmloop.identify.simulation.superset import Superset, inertia_parameter, scales_of, superset

Array = NDArray[np.float64]

MOMENT = ".time_s"  # how the full name of a moment ends
PHASE = ".phase_rad"  # and of where a wave begins


@dataclass(frozen=True, slots=True)
class LibraryTerm:
    """One effect at one place.

    `output` is that of a sensor effect or the state of a flow effect, `at` the state of another body than the first.
    """

    effect: Effect
    output: str | None
    parameters: tuple[EffectParameter, ...]
    keys: tuple[str, ...]  # full names of the parameters in the superset
    taken: tuple[str, str] | None  # a second inertia, and the nominal parameter that held it before
    scales: Scales  # sizes in the recordings, where the term acts
    at: str | None = None

    @property
    def label(self) -> str:
        """Name that tells the place too."""
        place = self.output if self.at is None else self.at
        return self.effect.name if place is None else f"{self.effect.name} of {place}"

    def place_told(self, plant: Plant) -> str | None:
        """Name what it acts on, the first body too where it could act at another; None where there is no choice."""
        return self.output or self.at or chosen_place(plant, self.use({}))

    def use(self, values: Mapping[str, float]) -> EffectUse:
        """Return the effect as a plant has it, with values by full name; what has none changes nothing."""
        pairs = zip(self.keys, self.parameters, strict=True)
        own = {each.name: values.get(key, each.neutral) for key, each in pairs}
        return EffectUse(self.effect.name, self.output, own, tuple(each.name for each in self.parameters), self.at)


def _starts(plant: Plant, term: LibraryTerm) -> tuple[Mapping[str, float], ...]:
    """Return the effect's own grid."""
    grid = term.effect.starts(site_of(plant, term.effect, term.output, term.at), term.scales)
    return tuple(dict(zip(term.keys, values, strict=True)) for values in grid)


@dataclass(frozen=True, slots=True)
class Problem:
    """A plant with its superset simulator, and the recordings it is held against."""

    plant: Plant
    engine: Superset
    train: tuple[Recording, ...]
    test: tuple[Recording, ...]
    terms: tuple[LibraryTerm, ...]
    starts: Mapping[str, tuple[Mapping[str, float], ...]]  # by LibraryTerm.label: points a fit begins from
    floors: Array  # (r,) smallest noise rms the resolution of each output allows
    drifts: Array  # (r,) largest rms that slow noise of each output may have
    memory: dict[tuple[object, ...], Array]  # what an initial state does to the outputs, see refit.start_slopes
    direct: tuple[Direct, ...]  # read off before any fit; the recordings are without them
    hidden: Mapping[int, tuple[int, int]] = field(default_factory=dict)  # by id of a recording: rows that count nothing
    weights: Mapping[int, Array] = field(default_factory=dict)  # (r,) by id of a recording: factors on what it leaves
    samples: float = 0.0  # independent ones of what is left, where it is a misfit and no noise

    def term(self, name: str) -> LibraryTerm | None:
        """Return the first term of that effect."""
        return next((term for term in self.terms if term.effect.name == name), None)


@dataclass(frozen=True, slots=True)
class Unknown:
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


def make_problem(plant: Plant, train: Sequence[Recording], test: Sequence[Recording], floors: Array) -> Problem:
    """List every term the plant can have, and where a fit of each begins."""
    train, test, direct = unwrapped(plant, train, test)
    engine = superset(plant)
    engine.hasten(COARSE_CHANGE)
    engine.follow(True)
    terms = _terms(plant, train)
    spread = np.std(np.concatenate([measured(plant, each) for each in train]), axis=0)
    drifts = np.maximum(SLOW_NOISE * spread, ROUNDING * floors)  # what wide steps round off moves as slowly as outputs
    return Problem(plant, engine, tuple(train), tuple(test), terms, _grids(plant, terms), floors, drifts, {}, direct)


def rescaled(problem: Problem, values: Mapping[str, float]) -> Problem:
    """Return the problem with fits that also begin from what effects may be beside these nominal values (SI).

    Data sheets know nothing of the load, and a refit may have run away: sizes of effects follow both.
    """
    own = tuple(replace(each, value=values.get(each.name, each.value)) for each in problem.plant.parameters)
    refit = replace(problem.plant, parameters=own)
    grids = _grids(refit, _terms(refit, problem.train))
    starts = {
        label: (*one, *(each for each in grids.get(label, ()) if each not in one))
        for label, one in problem.starts.items()
    }
    return replace(problem, starts=starts)


def _terms(plant: Plant, train: Sequence[Recording]) -> tuple[LibraryTerm, ...]:
    """List every term that recordings of the plant can have, by label: nothing depends on the order of a project."""
    sizes = cache(partial(scales_of, plant, train))
    terms, own = [], named_effects(plant)
    for use in all_uses(plant):
        effect = find_effect(use.name)
        if effect.seen_by in DIRECT or label_of(plant, use) in own:
            continue
        site = site_of(plant, effect, use.output, use.at)
        if effect.place == "torque" and not (site.moves or effect.anywhere):
            continue
        scales = sizes(site.output, site.balance)
        if effect.possible is not None and not effect.possible(site, scales):
            continue
        known = parameters_of(plant, use.name, use.output, use.at)
        parameters = tuple(_bounded(effect, each, scales) for each in known)
        label = label_of(plant, use)
        keys = tuple(f"{label}.{each.name}" for each in parameters)
        load = next((key for key, each in zip(keys, parameters, strict=True) if each.name == site.load), None)
        held = None if load is None else inertia_parameter(plant, site.balance)
        taken = None if load is None or held is None else (load, held)
        terms.append(LibraryTerm(effect, use.output, parameters, keys, taken, scales, use.at))
    return tuple(sorted(terms, key=lambda term: term.label))


def _grids(plant: Plant, terms: Sequence[LibraryTerm]) -> dict[str, tuple[Mapping[str, float], ...]]:
    """Return the points that a fit of each term begins from, by its label."""
    return {term.label: _starts(plant, term) for term in terms}


def _bounded(effect: Effect, parameter: EffectParameter, scales: Scales) -> EffectParameter:
    """Narrow a parameter to what the recordings can tell.

    A wave along a way has one period in it at least: a longer one is a spring or a load, which have names.
    """
    if parameter.name == "periods_per_m":
        parameter = replace(parameter, low=max(parameter.low, 1.0 / scales.travel))
    return parameter if effect.bounded is None else effect.bounded(parameter, scales)


def entered(values: Mapping[str, float], term: LibraryTerm, start: Mapping[str, float]) -> Mapping[str, float]:
    """Return the values with a term at its start; an inertia that it adds is taken from the nominal one."""
    whole = {**values, **start}
    if term.taken is not None:
        load, held = term.taken
        whole[held] = max(values[held] - whole[load], LEAST_INERTIA * values[held])
    return whole


def declared(plant: Plant, terms: Iterable[LibraryTerm]) -> list[EffectUse]:
    """Return the effects that a plant has and none of the terms is, with the values they have there."""
    named = {(term.effect.name, term.output, term.at) for term in terms}
    return [
        replace(use, values=values_of(plant, use))
        for use in plant.effects
        if not {(use.name, use.output, use.at), (use.name, None, use.at)} & named
    ]


def searched(term: LibraryTerm) -> bool:
    """Tell whether a term has a moment, which may be that of the largest of many chances."""
    return any(key.endswith(MOMENT) for key in term.keys)


def turning(terms: Iterable[LibraryTerm]) -> bool:
    """Tell whether there are waves along an angle among the terms."""
    return any(key.endswith(".phase_rad") for term in terms for key in term.keys)


def meeting(terms: Iterable[LibraryTerm]) -> bool:
    """Tell whether there are bodies that meet among the terms."""
    return any(term.effect.contact for term in terms)


def periods_of(term: LibraryTerm, at: Mapping[str, float]) -> float:
    """Return how often a wave repeats per turn, or in 2 pi m; 1 of one that is not told how often."""
    units = {".periods_per_rev": 1.0, ".periods_per_m": 2.0 * math.pi}
    return next(
        (unit * abs(at.get(key, 1.0)) for key in term.keys for end, unit in units.items() if key.endswith(end)), 1.0
    )


def follows_simulated(problem: Problem, term: LibraryTerm, at: Mapping[str, float]) -> bool:
    """Tell whether a wave follows the simulated angle: the recorded one is for what that has lost count of."""
    lost = problem.engine.recorded and periods_of(term, at) * problem.engine.lost >= 0.5 * math.pi
    return turning([term]) and not lost


def coordinates(problem: Problem, terms: Sequence[LibraryTerm], at: Mapping[str, float]) -> tuple[Unknown, ...]:
    """Return the unknowns of a hypothesis: the free nominal parameters, then those of its terms."""
    found = []
    step = FINE_DIFFERENCE_STEP if any(follows_simulated(problem, each, at) for each in terms) else DIFFERENCE_STEP
    if meeting(terms):
        step = ROUGH_DIFFERENCE_STEP
    for parameter in problem.plant.parameters:
        if parameter.free:
            value = at.get(parameter.name, parameter.value)
            positive = parameter.low >= 0.0 and value > 0.0 and not _may_vanish(parameter.name)
            size = abs(parameter.value) or abs(value) or 1.0
            if abs(value) > LEASH * size and parameter.name in scale_and_level(problem.plant):
                size = abs(value)  # so far off, what was given is no knowledge that would hold a fit
            found.append(Unknown(parameter.name, positive, parameter.low, parameter.high, size, step))
    for term in terms:
        for key, each in zip(term.keys, term.parameters, strict=True):
            size = max((abs(start[key]) for start in problem.starts[term.label] if key in start), default=1.0)
            found.append(Unknown(key, each.logarithmic, each.low, each.high, size or 1.0, step))
    return tuple(found)


def waves(terms: Iterable[LibraryTerm]) -> list[tuple[str, str]]:
    """Return the full names of size and phase of each wave of known period: its two quadratures have no bounds."""
    return [(term.keys[0], term.keys[1]) for term in terms if len(term.keys) == 2 and term.keys[1].endswith(PHASE)]


def waved(term: LibraryTerm, start: Mapping[str, float], shares: Array) -> Mapping[str, float]:
    """Return a start with the size and phase that `shares` of a wave and of that a quarter turn on add up to."""
    size, phase = term.keys[0], next(key for key in start if key.endswith(PHASE))
    most, least = term.parameters[0].high, term.parameters[0].low
    large = min(max(start[size] * float(np.hypot(*shares)), least), most)
    return {**start, size: large, phase: start[phase] + float(np.arctan2(shares[1], shares[0]))}


def stepped(terms: Sequence[LibraryTerm], unknowns: Sequence[Unknown], here: Array, step: Array) -> Array:
    """Return coordinates (k,) a step away; a wave of known period goes by what the step does to its two quadratures.

    In those it is linear. Its size and phase by themselves lead astray: that of a small wave turns by any angle.
    """
    there = here + step
    places = {each.name: k for k, each in enumerate(unknowns)}
    for keys in waves(terms):
        if not places.keys() >= set(keys):
            continue
        size, phase = (places[key] for key in keys)
        side = math.copysign(1.0, here[size])
        turn = float(np.clip(side * here[size] * step[phase] * unknowns[phase].scale, -LONGEST_STEP, LONGEST_STEP))
        along = side * there[size]
        there[size] = math.copysign(math.hypot(along, turn), here[size])
        there[phase] = here[phase] + math.atan2(turn, along) / unknowns[phase].scale
    return there


def as_written(values: Mapping[str, float]) -> Mapping[str, float]:
    """Return values with the phases of waves within half a turn: a fit may have gone around several times."""
    return {key: math.remainder(each, math.tau) if key.endswith(PHASE) else each for key, each in values.items()}


def _may_vanish(name: str) -> bool:
    """Viscous friction may well be nothing at all; its logarithm would run away."""
    return name.startswith("b_") or name.startswith("delay")


def first_point(problem: Problem, recordings: Sequence[Recording]) -> Point:
    """Return the nominal values as given, every recording at rest."""
    values = {parameter.name: parameter.value for parameter in problem.plant.parameters}
    return Point(values, tuple(full_start(problem, recording) for recording in recordings))


def full_start(problem: Problem, recording: Recording) -> Array:
    """Return the usual start in the superset's states: at rest, or of what moves by itself as its readings begin."""
    start = np.zeros(len(problem.engine.states))
    start[: len(problem.plant.states)] = usual_start(problem.plant, recording)
    return start


def outputs_of(problem: Problem, recording: Recording) -> Array:
    """Return the recorded outputs (n, r)."""
    return measured(problem.plant, recording)
