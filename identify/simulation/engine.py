"""Simulate a plant with effects: put the terms together, hand them to the compiled simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.assembly import OUTPUT, Assembly
from firmloop.identify.plants.attach import inside_of, placed
from firmloop.identify.plants.effect import Effect, Site
from firmloop.identify.plants.linear_forms import Forms, FormWriter, form_writer
from firmloop.identify.plants.plant import Balance, Plant, Varying
from firmloop.identify.simulation.course import Course
from firmloop.identify.simulation.marshal import Equations, Job, equations_of, job, library, run_job
from firmloop.identify.simulation.segments import Segments, segments, slew_function

Array = NDArray[np.float64]

_STEP = 1e-6  # of a parameter, for its difference quotient
_SHOWN = (1e-8, 1e-3)  # of the largest reading: changes that tell the slope of what never moves
_STEP_FACTOR = 30.0
_STEP_TRIALS = 6
_KEPT = 64


@dataclass(slots=True)
class EffectSimulator:
    """A plant with effects, ready to run for any values of its parameters; the interface is that of Simulator.

    An effect at its neutral value is not there at all; `inner` are the equations where one changes them inside. Slopes
    are difference quotients: the simulation is right to about 1e-12, so that they are good to about six digits.
    """

    plant: Plant
    writer: FormWriter
    equations: Equations | None  # of a plant that is not linear
    inner: Equations | None
    effects: tuple[tuple[Effect, Site, tuple[int, ...]], ...]
    watched: NDArray[np.intp]  # constants of which one that is not neutral makes an effect present
    still: Array  # their neutral values
    owner: NDArray[np.intp]  # the number of the effect of each
    sizes: Array  # (k,) typical size of each constant, where its value is 0
    varying: tuple[tuple[Varying, int], ...]  # which constants the start state moves
    jobs: dict[bytes, Job] = field(default_factory=dict)
    written: dict[bytes, Forms] = field(default_factory=dict)  # by the nominal constants
    cuts: dict[tuple[object, ...], tuple[Course, Segments]] = field(default_factory=dict)
    taken: Array = field(default_factory=lambda: np.zeros(1))  # steps of all runs so far, linear ones a half

    @property
    def states(self) -> int:
        """Number of initial states."""
        return len(self.plant.states)

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return len(self.plant.outputs)

    @property
    def sticking(self) -> Sequence[int]:
        """The states that dry friction can hold at rest: speeds, where the plant has effects."""
        moves = [b.state for b in self.plant.balances if b.kind in ("torque", "force")]
        return moves if self.effects else []

    def run(self, course: Course, constants: Array, start: Array) -> Array:
        """Return the outputs (q, r) from state `start` in the first row; rows after a divergence are NaN."""
        made = self._job(self._own(constants, start))
        made.problem.taken = self.taken.ctypes.data
        return run_job(made, self._segments(course, made), np.asarray(start, dtype=np.float64), course)

    def run_with_slopes(
        self, course: Course, constants: Array, start: Array, which: Sequence[int]
    ) -> tuple[Array, Array]:
        """Also return dy/d(constants[which], start): (q, r, len(which) + number of states)."""
        base, slopes = self.slopes(course, constants, start, which, range(self.states), 30.0 * _STEP)
        for place, index in enumerate(which):
            # Twice as many runs, but a combination without effect can then be told from one with little.
            moved = np.array(constants, dtype=np.float64)
            moved[index] -= self._step(constants, index, 30.0 * _STEP)
            if self.plant.parameters[index].low <= moved[index] <= self.plant.parameters[index].high:
                back = (base - self.run(course, moved, start)) / (constants[index] - moved[index])
                slopes[..., place] = 0.5 * (slopes[..., place] + back)
        return base, slopes

    def slopes(
        self, course: Course, constants: Array, start: Array, which: Sequence[int], states: Sequence[int], share: float
    ) -> tuple[Array, Array]:
        """Return the outputs and their one-sided slopes (q, r, len(which) + len(states)), with steps of a `share`."""
        base = self.run(course, constants, start)
        slopes = np.empty((*base.shape, len(which) + len(states)))
        for place, index in enumerate(which):
            moved = np.array(constants, dtype=np.float64)
            moved[index] += self._step(constants, index, share)
            slopes[..., place] = (self.run(course, moved, start) - base) / (moved[index] - constants[index])
        for place, index in enumerate(states):
            slopes[..., len(which) + place] = self._start_slope(course, constants, start, index, base)
        return base, slopes

    def _start_slope(self, course: Course, constants: Array, start: Array, index: int, base: Array) -> Array:
        """Return the slope (q, r) for one initial state; a load or a zero takes a step that shows, and no more."""
        step = _STEP * max(abs(float(start[index])), 1.0)
        own = any(one.state == index for one, _ in self.varying)
        for _ in range(_STEP_TRIALS if own else 1):
            shifted = np.array(start, dtype=np.float64)
            shifted[index] += step
            moved = self.run(course, constants, shifted) - base
            slope = np.asarray(moved / step)
            shown = _largest(moved) / max(_largest(base), 1e-300)
            if _SHOWN[0] < shown < _SHOWN[1]:
                break
            step *= _STEP_FACTOR if shown <= _SHOWN[0] else 1.0 / _STEP_FACTOR
        return slope

    def _own(self, constants: Array, start: Array) -> Array:
        """Return the constants as the recording that begins there has them."""
        if not self.varying:
            return constants
        moved = np.array(constants, dtype=np.float64)
        for one, index in self.varying:
            known = self.plant.parameters[index]
            moved[index] = min(max(one.at(float(moved[index]), float(start[one.state])), known.low), known.high)
        return moved

    def _step(self, constants: Array, index: int, share: float) -> float:
        step = share * (abs(float(constants[index])) or 1e-3 * float(self.sizes[index]))
        return step if constants[index] + step <= self.plant.parameters[index].high else -step

    def run_states(self, course: Course, constants: Array, start: Array) -> Array:
        """Return every state (q, n), those that effects have added behind the plant's own."""
        constants = self._own(constants, start)
        assembly = self.assemble(constants)
        n = len(assembly.a)
        assembly.read_x, assembly.read_u = np.eye(n), np.zeros((n, assembly.inputs))
        assembly.read_c = np.zeros(n)
        assembly.terms = [term for term in assembly.terms if term.what != OUTPUT]
        equations = self.equations_at(constants)
        made = job(assembly, replace(equations, reading=0) if equations is not None else None, constants)
        return run_job(made, self._segments(course, made), np.asarray(start, dtype=np.float64), course)

    def usual_state(self, course: Course, constants: Array, start: Array) -> Array:
        """Return where the plant is on average (n,) on its way from `start`: another guess for where it began."""
        if self.equations is None:
            return start
        states = self.run_states(course, constants, start)[:, : self.states]
        seen = states[np.all(np.isfinite(states), axis=1)]
        return np.asarray(seen.mean(axis=0)) if len(seen) else start

    def steps_of(self, course: Course, constants: Array, start: Array) -> float:
        """Return how many steps a run takes: the more, the stiffer the plant is with these constants."""
        before = float(self.taken[0])
        self.run(course, constants, start)
        return float(self.taken[0]) - before

    def assemble(self, constants: Array) -> Assembly:
        """Put the linear part and every effect that is not neutral together."""
        return self._assembled(constants, self._present(constants))

    def _assembled(self, constants: Array, present: Sequence[tuple[Effect, Site, tuple[int, ...]]]) -> Assembly:
        forms = self._forms(constants)
        if self._equations(present) is self.inner is not None:
            # What is changed inside is linear no longer, and read as the equations say.
            forms = replace(
                forms, **{name: np.zeros_like(getattr(forms, name)) for name in ("read_x", "read_u", "read_c")}
            )
        assembly = Assembly(self.plant, forms, constants)
        if any(effect.place in ("voltage", "current") for effect, _, _ in self.effects):
            assembly.dynamic_current()
        for effect, site, own in present:
            assembly.act_at(site.balance)
            effect.attach(assembly, site, tuple(float(constants[k]) for k in own))
        assembly.act_at(assembly.bodies[0] if assembly.bodies else -1)
        return assembly

    def equations_at(self, constants: Array) -> Equations | None:
        """Return the compiled equations that hold at `constants`."""
        return self._equations(self._present(constants))

    def _equations(self, present: Sequence[tuple[Effect, Site, tuple[int, ...]]]) -> Equations | None:
        return self.inner if any(inside_of(self.plant, site) for _, site, _ in present) else self.equations

    def _present(self, constants: Array) -> list[tuple[Effect, Site, tuple[int, ...]]]:
        moved = np.asarray(constants)[self.watched] != self.still
        return [self.effects[k] for k in sorted(set(self.owner[moved].tolist()))]

    def _forms(self, constants: Array) -> Forms:
        nominal = np.asarray(constants[: self.plant.rate.numel_in(2)], dtype=np.float64)
        key = nominal.tobytes()
        found = self.written.get(key)
        if found is None:
            while len(self.written) >= _KEPT:
                self.written.pop(next(iter(self.written)))
            found = self.written[key] = self.writer.forms(nominal)
        return found

    def _job(self, constants: Array) -> Job:
        key = np.asarray(constants, dtype=np.float64).tobytes()
        found = self.jobs.get(key)
        if found is None:
            while len(self.jobs) >= _KEPT:
                self.jobs.pop(next(iter(self.jobs)))
            present = self._present(constants)
            found = self.jobs[key] = job(self._assembled(constants, present), self._equations(present), constants)
        return found

    def _segments(self, course: Course, made: Job) -> Segments:
        delay = made.delay
        timing = made.timing
        rest = made.rest if self.plant.remembers else None
        moment = (course.first, course.end, delay, rest)
        key = (id(course.time), id(course.drive), id(course.knots), *moment, *timing.key())
        found = self.cuts.get(key)
        # The course is kept with its segments, so that its identity cannot be another's.
        if found is not None and found[0].drive is course.drive and found[0].knots is course.knots:
            return found[1]
        while len(self.cuts) >= 4 * _KEPT:
            self.cuts.pop(next(iter(self.cuts)))
        cut = segments(course, timing, delay, rest, self.outputs, slew_function(library()))
        self.cuts[key] = (course, cut)
        return cut


def _largest(values: Array) -> float:
    """Return the largest magnitude; a simulation that has diverged has none."""
    return float(np.max(np.abs(np.nan_to_num(values)), initial=0.0))


_SIMULATORS: dict[tuple[object, ...], EffectSimulator] = {}


def effect_simulator(plant: Plant) -> EffectSimulator:
    """Return the simulator of a plant with effects; one per set of equations and effects, whatever the values."""
    key = (
        plant.kind,
        plant.rate.serialize(),
        plant.reading.serialize(),
        plant.inputs,
        plant.outputs,
        plant.states,
        tuple((use.name, use.output, use.at) for use in plant.effects),
        tuple((p.name, p.low, p.high) for p in plant.parameters),
        plant.varying,
        plant.delay,
        plant.input_at_rest,
        tuple(map(_told, plant.balances)),
    )
    found = _SIMULATORS.get(key)
    if found is None:
        writer = form_writer(plant)
        equations = None if writer.linear_rate and writer.linear_reading else equations_of(plant, writer)
        effects = placed(plant)
        inner = None
        if any(inside_of(plant, site) for _, site, _ in effects):
            inner = equations_of(_opened(plant, effects), replace(writer, linear_reading=False, linear_effort=False))
        sizes = np.ones(len(plant.parameters))
        neutral = [
            (own[k], value, number)
            for number, (effect, site, own) in enumerate(effects)
            for k, value in effect.neutral(site)
        ]
        watched, owner = (np.array([each[k] for each in neutral], dtype=np.intp) for k in (0, 2))
        still = np.array([value for _, value, _ in neutral], dtype=np.float64)
        places = {p.name: index for index, p in enumerate(plant.parameters)}
        varying = tuple((one, places[one.parameter]) for one in plant.varying if one.parameter in places)
        found = EffectSimulator(plant, writer, equations, inner, effects, watched, still, owner, sizes, varying)
        while len(_SIMULATORS) >= _KEPT:
            _SIMULATORS.pop(next(iter(_SIMULATORS)))
        _SIMULATORS[key] = found
    return found


def _told(balance: Balance) -> tuple[object, ...]:
    """Return what tells a balance from another: an `ode` may say of the same equations where effects enter."""
    functions = (balance.per, balance.effort, balance.current, balance.resistance)
    texts = tuple(None if function is None else function.serialize() for function in functions)
    return balance.kind, balance.state, balance.position, balance.to, balance.inside, texts


def _opened(plant: Plant, effects: Sequence[tuple[Effect, Site, tuple[int, ...]]]) -> Plant:
    """Return the plant with the parameters of effects in its equations, all constants being arguments of them."""
    inside = plant.inside
    assert inside is not None
    nominal = plant.rate.numel_in(2)
    x, u, p = (
        ca.SX.sym(name, size)
        for name, size in zip("xup", (len(plant.states), len(plant.inputs), len(plant.parameters)), strict=True)
    )
    z = list(map(ca.SX, inside.neutral))
    for _, site, own in effects:
        for place, index in zip(inside_of(plant, site), own, strict=False):
            z[place] = p[index]
    rate, reading, effort = (
        ca.Function(made.name(), [x, u, p], [made(x, u, p[:nominal], ca.vertcat(*z))], ["x", "u", "p"], ["result"])
        for made in (inside.rate, inside.reading, inside.effort)
    )
    shaft = next(k for k, b in enumerate(plant.balances) if b.kind in ("torque", "force"))
    balances = tuple(replace(b, effort=effort) if k == shaft else b for k, b in enumerate(plant.balances))
    return replace(plant, rate=rate, reading=reading, balances=balances)
