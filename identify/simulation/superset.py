"""A Superset: a plant with every effect it can have, all neutral, to try them one by one without building anything."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.attach import all_uses, label_of, parameters_of, site_of, with_effects, with_position
from firmloop.identify.plants.effect import Scales
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.clipping import gathering, rested
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.at_rest import known_states
from firmloop.identify.simulation.course import LONGEST_CHANGE, MOST_STEPS, Course
from firmloop.identify.simulation.engine import EffectSimulator, effect_simulator
from firmloop.identify.simulation.linear_filter import integrated
from firmloop.identify.simulation.simulate import course_of, rest_start

Array = NDArray[np.float64]

_STRETCH = "clock_skew.ratio"  # by which a slow clock stretches the time between readings
_PIECES = 100  # of a recording, over which an acceleration is seen
_CHANGES = 0.01  # of the largest input: less from row to row is no change
_BACK = 0.05  # of the way there
_FEW_CHANGES = 2  # of the input, in a recording: on and off


@dataclass(slots=True)
class Superset:
    """A plant with all its candidates; `neutral` holds the values at which it is the plant itself.

    Waves per turn follow the simulated angle; where `recorded` is set, the recorded one, if there is one, less how far
    that is known to have `strayed` from the true one: after many turns under a disturbance a simulated angle has lost
    count. A wave follows that angle only where the simulated one is off (`lost`, rad) by a quarter of its period: a
    force at a recorded place knows the answer. `longest_change` is that of Course.
    """

    plant: Plant
    names: tuple[str, ...]
    neutral: Mapping[str, float]
    states: tuple[str, ...]
    engine: EffectSimulator
    courses: dict[int, tuple[Recording, Course]]
    recorded: bool = False
    lost: float = math.inf
    longest_change: float = LONGEST_CHANGE
    strayed: Mapping[int, Array] = field(default_factory=dict)  # (n,) in rad, by the recording's identity
    known: dict[int, tuple[Recording, tuple[int, ...]]] = field(default_factory=dict)  # states, as `courses` are
    places: Mapping[str, int] = field(init=False)  # of the names
    still: Array = field(init=False)  # (k,) the neutral values

    def __post_init__(self) -> None:
        """Lay out the neutral values as the names are."""
        self.places = {name: place for place, name in enumerate(self.names)}
        self.still = np.array([self.neutral[name] for name in self.names])

    @property
    def steps(self) -> float:
        """Steps of all simulations so far, in millions, linear ones a half: what a budget counts everywhere."""
        return 1e-6 * float(self.engine.taken[0])

    def simulate(
        self, recording: Recording, parameters: Mapping[str, float], start: Array | None, most: float = math.inf
    ) -> Array:
        """Return the outputs (n, r); rows after a divergence, or after `most` million steps, are NaN."""
        course = self.course(recording)
        course = replace(course, most_steps=min(1e6 * most, course.most_steps))
        return self.engine.run(course, self.constants(parameters), self.begin(recording, start))

    def unfed(self, recording: Recording, parameters: Mapping[str, float]) -> int:
        """Return how many of the last rows are read after the recorded input has ended: by a clock that runs slow."""
        stretch = parameters.get(_STRETCH, 0.0)
        if not stretch > 0.0:
            return 0
        time = recording.time
        last = float(time[0]) + (float(time[-1]) - float(time[0])) / (1.0 + stretch)
        return len(time) - int(np.searchsorted(time, last, side="right"))

    def slopes(
        self, recording: Recording, parameters: Mapping[str, float], names: Sequence[str], start: Array | None
    ) -> Array:
        """Return the slopes (n, r, k) of the outputs for parameters or, as `start.<state>`, for the start state."""
        which = [self.places[name] for name in names if not name.startswith("start.")]
        states = [self.states.index(name.removeprefix("start.")) for name in names if name.startswith("start.")]
        _, slopes = self.engine.slopes(
            self.course(recording), self.constants(parameters), self.begin(recording, start), which, states, 1e-6
        )
        own, first = iter(range(len(which))), iter(range(len(which), len(names)))
        return slopes[..., [next(first) if name.startswith("start.") else next(own) for name in names]]

    def constants(self, parameters: Mapping[str, float]) -> Array:
        """Return all constants (k,), neutral but for `parameters`."""
        whole = self.still.copy()
        for name, value in parameters.items():
            if name not in self.places:
                raise IdentifyError(f"{name} is no parameter of this plant or of an effect it can have")
            whole[self.places[name]] = value
        return whole

    def begin(self, recording: Recording, start: Array | None) -> Array:
        """Return the start state; one without the position that an effect has added gets it from the recording."""
        if start is not None and len(start) == len(self.states):
            return start
        rest = rest_start(self.plant, recording)
        return rest if start is None else np.concatenate([start, rest[len(start) :]])

    def known_states(self, recording: Recording) -> tuple[int, ...]:
        """Return the states that a recording that begins at rest has as `begin` has them, see `known_states`."""
        if id(recording) not in self.known:
            self.known[id(recording)] = recording, known_states(self.plant, recording)
        return self.known[id(recording)][1]

    def hasten(self, longest_change: float) -> None:
        """Take longer steps from now on."""
        self.longest_change = longest_change
        self.courses.clear()

    def follow(self, recorded: bool) -> None:
        """Let waves per turn follow the recorded or the simulated angle from now on."""
        if recorded != self.recorded:
            self.recorded = recorded
            self.courses.clear()

    def lose(self, lost: float) -> None:
        """Take the simulated angle to be off by so much, rad, from now on."""
        if lost != self.lost:
            self.lost = lost
            self.courses.clear()

    def amend(self, strayed: Mapping[int, Array]) -> None:
        """Take that off the recorded angles from now on."""
        if strayed or self.strayed:
            self.strayed = strayed
            self.courses.clear()

    def angle(self, recording: Recording) -> Array | None:
        """Return the angle (n,) in rad that waves follow where that is the recorded one, None where there is none."""
        angle = travelled(recording)
        return angle if angle is None or id(recording) not in self.strayed else angle - self.strayed[id(recording)]

    def course(self, recording: Recording) -> Course:
        """Return what drives the simulation of a recording; made once."""
        found = self.courses.get(id(recording))
        if found is None or found[0] is not recording:
            while len(self.courses) >= 64:
                self.courses.pop(next(iter(self.courses)))
            course = replace(
                course_of(self.plant, recording),
                turn=self.angle(recording) if self.recorded else None,
                lost=self.lost,
                longest_change=self.longest_change,
                most_steps=MOST_STEPS * len(recording.time),
            )
            found = self.courses[id(recording)] = (recording, course)
        return found[1]


def superset(plant: Plant) -> Superset:
    """Give a plant every effect it can have, at the values that change nothing; effects it has keep their values."""
    held = {label_of(plant, use): use for use in plant.effects}
    uses = [held.pop(label_of(plant, use), use) for use in all_uses(plant)]
    uses += held.values()  # those that act at another body than the first
    whole = with_effects(plant, uses)
    names = tuple(parameter.name for parameter in whole.parameters)
    neutral = {parameter.name: parameter.value for parameter in whole.parameters}
    engine = effect_simulator(whole)
    return Superset(whole, names, MappingProxyType(neutral), tuple(s.name for s in whole.states), engine, {})


def starts_of(
    plant: Plant, recordings: Sequence[Recording], name: str, output: str | None = None
) -> tuple[dict[str, float], ...]:
    """Return the points from which the fit of an effect begins, by full parameter name."""
    effect = find_effect(name)
    site = site_of(plant, effect, output)
    label = _label(plant, name, output)
    known = [f"{label}.{parameter.name}" for parameter in parameters_of(plant, name, output)]
    return tuple(
        dict(zip(known, values, strict=True))
        for values in effect.starts(site, scales_of(plant, recordings, site.output, site.balance))
    )


def _label(plant: Plant, name: str, output: str | None) -> str:
    made = with_effects(
        plant, [use for use in all_uses(plant) if use.name == name and output in (use.output, None)][:1]
    )
    parameters = made.parameters[made.rate.numel_in(2) :]
    return parameters[0].name.rpartition(".")[0]


def scales_of(plant: Plant, recordings: Sequence[Recording], output: int, balance: int) -> Scales:
    """Measure typical sizes in the recordings; what is not recorded is taken from the nominal simulation."""
    bare = with_position(with_effects(plant, ()))
    engine = effect_simulator(with_effects(bare, ()))
    peaks: dict[str, float] = {}

    def see(key: str, values: Array) -> None:
        finite = values[np.isfinite(values)]
        if len(finite):
            peaks[key] = max(peaks.get(key, 0.0), float(np.max(np.abs(finite))))

    low, high, places, step, span, least = math.inf, -math.inf, [0.0], math.inf, 0.0, math.inf
    changes: list[float] = []
    for recording in recordings:
        course = course_of(bare, recording)
        constants = np.array([p.value for p in bare.parameters])
        assembly = engine.assemble(constants)
        states = states_of(engine, course, constants, rest_start(bare, recording))
        for index, signal in enumerate(bare.states):
            if signal.name in recording.columns:
                states[:, index] = recording.columns[signal.name]
        known = [signal.name in recording.columns for signal in bare.states]
        if assembly.position >= 0 and known[assembly.speed] and not known[assembly.position]:
            way = integrated(states[:, assembly.speed], recording.time)
            states[:, assembly.position] = states[0, assembly.position] + way
        column = recording.columns[plant.outputs[output].name]
        low, high = min(low, float(column.min())), max(high, float(column.max()))
        see("input", course.drive[:, 0])
        moved, size = np.diff(course.drive[:, 0]), np.abs(course.drive[:, 0])
        see("slew", moved / np.diff(course.time))
        changes.extend(course.time[1:][np.abs(moved) > _CHANGES * np.max(size)].tolist())
        see("fall", np.maximum.accumulate(size) - size)
        see("up", np.maximum(course.drive[:, 0], 0.0))
        see("down", np.minimum(course.drive[:, 0], 0.0))
        least = min(least, float(np.min(size)))
        see("current", states @ assembly.current_x + course.drive @ assembly.current_u)
        see("effort", efforts(bare, engine, assembly, states, course.drive, constants))
        if not np.any(course.drive):  # what moves by itself is driven by what slows it down
            see("freely", _slowing(recording, states, assembly.speed, assembly.position, known))
        flowing = bare.balances[balance].current if balance >= 0 else None
        bent = balance >= 0 and not np.any(assembly.forms.balances[balance].current)
        if flowing is not None and (bent or bare.balances[balance].inside):
            see("current", along(flowing, states, course.drive, constants))
        if assembly.speed >= 0:
            see("speed", states[:, assembly.speed])
        if assembly.position >= 0:
            places.extend(float(v) for v in (states[:, assembly.position].min(), states[:, assembly.position].max()))
        if balance >= 0:
            see("level", states[:, plant.balances[balance].state])
        step, span = min(step, course.step), max(span, float(course.time[-1] - course.time[0]))
    forms = engine.writer.forms(np.array([p.value for p in bare.parameters[: bare.rate.numel_in(2)]]))
    inertia = next(
        (1.0 / f.per for f, b in zip(forms.balances, bare.balances, strict=True) if b.kind in ("torque", "force")), 1.0
    )
    peaks["effort"] = peaks.get("effort", 0.0) or inertia * peaks.get("freely", 0.0)
    sizes = {key: value if value > 0.0 else 1.0 for key, value in peaks.items()}
    largest = max(abs(low), abs(high)) or 1.0
    seen = [recording.columns[plant.outputs[output].name] for recording in recordings]
    end = gathering(seen)
    other_way = min(peaks.get("up", 0.0), peaks.get("down", 0.0))
    return Scales(
        input=sizes.get("input", 1.0),
        output=largest,
        output_low=low,
        output_high=high,
        plateau=largest if end is None else end.level,
        rested=rested(seen),
        current=sizes.get("current", 1.0),
        effort=sizes.get("effort", 1.0),
        speed=sizes.get("speed", 1.0),
        travel=(max(places) - min(places)) or 1.0,
        place_low=min(places),
        place_high=max(places),
        inertia=inertia,
        resistance=next((f.resistance for f in forms.balances if f.resistance > 0.0), 1.0),
        step=step,
        span=span,
        begin=min(float(recording.time[0]) for recording in recordings),
        end=max(float(recording.time[-1]) for recording in recordings),
        slew=sizes.get("slew", 1.0),
        fall=peaks.get("fall", 0.0),
        other_way=other_way,
        least=0.0 if other_way > 0.0 else least,
        level=sizes.get("level", 1.0),
        switched=tuple(changes) if len(changes) <= _FEW_CHANGES * len(recordings) else (),
        comes_back=comes_back(recordings),
    )


def comes_back(recordings: Sequence[Recording]) -> bool:
    """Tell whether the place, by its speed, comes back a share of its way in a recording; so it does if it is read."""
    for recording in recordings:
        speed = next((column for name, column in recording.columns.items() if name.startswith("speed_")), None)
        if speed is None or any(name.startswith("position_") for name in recording.columns):
            return True
        way = integrated(speed, recording.time)
        back = min(np.max(np.maximum.accumulate(way) - way), np.max(way - np.minimum.accumulate(way)))
        if back > _BACK * np.ptp(way):
            return True
    return False


def _slowing(recording: Recording, states: Array, speed: int, position: int, known: Sequence[bool]) -> Array:
    """Return by how much a body slows down (1,), by its recorded speed or position: its fastest, half by half.

    What swings is turned round all the time by what slows nothing down.
    """
    width = max(len(recording.time) // _PIECES, 3)
    if speed >= 0 and known[speed]:
        moved = states[:, speed]
    elif position >= 0 and known[position]:
        moved = np.gradient(scipy.ndimage.uniform_filter1d(states[:, position], width), recording.time)
    else:
        return np.zeros(1)
    first, last = (np.max(np.abs(half)) for half in np.array_split(scipy.ndimage.uniform_filter1d(moved, width), 2))
    return np.array([2.0 * (first - last) / (recording.time[-1] - recording.time[0])])


def efforts(
    plant: Plant, engine: EffectSimulator, assembly: Assembly, states: Array, drive: Array, constants: Array
) -> Array:
    """Return what the drive gives, (n,)."""
    if engine.writer.linear_effort:
        return np.asarray(states @ assembly.effort_x + drive @ assembly.effort_u)
    bent = plant.balances[plant.driven].effort
    assert bent is not None
    return along(bent, states, drive, constants)


def along(function: ca.Function, states: Array, drive: Array, constants: Array) -> Array:
    """Evaluate a scalar function (x, u, p) in every row, (n,)."""
    nominal = constants[: function.numel_in(2)]
    every = function.map(len(states))(states.T, drive.T, np.tile(nominal[:, None], len(states)))
    return np.asarray(every).reshape(-1)


def inertia_parameter(plant: Plant, balance: int) -> str | None:
    """Return the free nominal parameter that is the inertia of a balance, None where there is no such one."""
    bare = with_effects(plant, ())
    engine = effect_simulator(bare)
    given = np.array([p.value for p in bare.parameters])
    inertia = 1.0 / engine.writer.forms(given).balances[balance].per
    for index, parameter in enumerate(bare.parameters):
        moved = given.copy()
        moved[index] *= 1.01
        ratio = 1.0 / engine.writer.forms(moved).balances[balance].per / inertia
        if parameter.free and math.isclose(ratio, 1.01, rel_tol=1e-6):
            return parameter.name
    return None


def travelled(recording: Recording, unit: str = "rad") -> Array | None:
    """Return the angle (n,) in rad, or the position in m: recorded, or the integral of the recorded speed."""
    if f"position_{unit}" in recording.columns:
        return np.ascontiguousarray(recording.columns[f"position_{unit}"], dtype=np.float64)
    if f"speed_{unit}_s" not in recording.columns:
        return None
    return integrated(recording.columns[f"speed_{unit}_s"], recording.time)


def states_of(engine: EffectSimulator, course: Course, constants: Array, start: Array) -> Array:
    """Simulate all states (n, x) instead of the outputs."""
    return engine.run_states(course, constants, start)
