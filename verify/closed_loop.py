"""Close the loop step by step: the plant in this process, the controller behind any link, the same bits on each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identify.plant import IdentifyError, Plant
from identify.simulate import constants_of
from quantize.program import Program
from verify.compare import record_type
from verify.links import Link
from verify.reference import Raw, element_type, start_parameters
from verify.stimuli import to_physical, to_raw

Array = NDArray[np.float64]

LONGEST_SUBSTEP = 0.25  # over the fastest eigenvalue's magnitude, as in identify/simulate.py
MOST_SUBSTEPS = 1000  # a plant that needs more in one period is too stiff for a step-by-step run


@dataclass(frozen=True, slots=True)
class LoopRun:
    """A closed-loop run; all arrays one row a step, plant and controller in physical units, `raw` as the C holds it."""

    reference: Array
    measurement: Array
    command: Array
    status: NDArray[np.uint32]
    raw: Raw  # packed outputs and status, for the comparison of bits

    def same_as(self, other: LoopRun) -> bool:
        """Whether every measurement, command and status word has the same bits."""
        return self.raw.tobytes() == other.raw.tobytes() and self.measurement.tobytes() == other.measurement.tobytes()


@dataclass(frozen=True, slots=True)
class PlantLoop:
    """What a closed-loop run needs beside the controller; `roles` are its inputs for the reference and the plant.

    `states` are its inputs for the plant's states, in their order; a role that nothing has is empty.
    """

    plant: Plant
    reference: Array  # one value a step
    roles: tuple[str, str]
    states: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LoopCheck:
    """The run on the target, and the steps at which it is not that of the host, bit for bit."""

    run: LoopRun
    expected: LoopRun
    different: tuple[int, ...]


class SteppedPlant:
    """A plant without effects that takes one input a period and tells its outputs; Runge-Kutta of order four.

    The input acts `delay` later; the fraction of a period that remains of it splits the period in two.
    """

    def __init__(self, plant: Plant, period: float) -> None:
        if plant.effects:
            names = ", ".join(use.name for use in plant.effects)
            raise IdentifyError(f"plant {plant.kind}: the loop is closed without effects; this one has {names}")
        self._constants = np.asarray(constants_of(plant), dtype=np.float64)
        x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u", len(plant.inputs))
        h, p = ca.SX.sym("h"), ca.DM(self._constants)
        slope = ca.Function("slope", [x, u], [ca.jacobian(plant.rate(x, u, p), x)])
        fastest = float(np.max(np.abs(np.linalg.eigvals(np.asarray(slope(0, 0)))), initial=0.0))
        parts = max(1, math.ceil(period * fastest / LONGEST_SUBSTEP))
        if parts > MOST_SUBSTEPS:
            raise IdentifyError(
                f"plant {plant.kind}: its fastest eigenvalue is {fastest:.3g} 1/s, too fast for steps of {period:g} s; "
                "leave the fast part out of the plant"
            )
        k1 = plant.rate(x, u, p)
        k2 = plant.rate(x + h / 2 * k1, u, p)
        k3 = plant.rate(x + h / 2 * k2, u, p)
        k4 = plant.rate(x + h * k3, u, p)
        one = ca.Function("one", [x, u, h], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])
        moved = x
        for _ in range(parts):
            moved = one(moved, u, h / parts)
        self._advance = ca.Function("advance", [x, u, h], [moved])
        self._read = ca.Function("read", [x, u], [plant.reading(x, u, p)])
        delay = _delay(plant, self._constants)
        whole = int(delay / period + 1e-9)
        self._late = max(0.0, delay - whole * period)
        self._early = period - self._late
        self._inputs = [
            np.zeros(len(plant.inputs)) for _ in range(whole + 1)
        ]  # those that have not acted out, oldest first
        self._state = np.zeros(len(plant.states))

    def read(self) -> Array:
        """Return the outputs (r,), before the next input acts."""
        return np.asarray(self._read(self._state, self._inputs[0])).ravel()

    @property
    def state(self) -> Array:
        """The states (n,)."""
        return self._state

    def apply(self, values: Array) -> None:
        """Hold the inputs (m,) for one period, from their delay on."""
        self._inputs.append(values)
        before = self._inputs.pop(0)
        if self._late > 0.0:
            self._state = np.asarray(self._advance(self._state, before, self._late)).ravel()
        self._state = np.asarray(self._advance(self._state, self._inputs[0], self._early)).ravel()


def check_loop(program: Program, loop: PlantLoop, host: Link, target: Link) -> LoopCheck:
    """Close the loop with the controller on the host, then on the target, and compare every step."""
    expected = close_loop(program, loop.plant, host, loop.reference, loop.roles, loop.states)
    run = close_loop(program, loop.plant, target, loop.reference, loop.roles, loop.states)
    bits = (run.measurement.view("<u8") != expected.measurement.view("<u8")) | (run.raw != expected.raw)
    return LoopCheck(run, expected, tuple(int(step) for step in np.flatnonzero(bits)))


def close_loop(
    program: Program,
    plant: Plant,
    link: Link,
    reference: Array,
    roles: tuple[str, str],
    states: tuple[str, ...] = (),
) -> LoopRun:
    """Run the controller against the plant, both from their first state, one exchange over the link a step.

    Parameters
    ----------
    reference
        what the controller is told to follow, one value a step, in its unit
    roles
        names of the controller's inputs for the reference and for the plant's first output, empty where there is
        none; others read zero
    states
        names of its inputs for the plant's states
    """
    model = SteppedPlant(plant, program.period)
    kind = record_type(program)
    row = np.dtype([(value.name, element_type(value.number)) for value in (*program.inputs, *program.parameters)])
    inputs = {value.name: value for value in program.inputs}
    told = to_raw(inputs[roles[0]], np.asarray(reference, dtype=np.float64)) if roles[0] else None
    steps = len(reference)
    measurement = np.empty(steps)
    answers = np.empty(steps, dtype=kind)
    sent = np.zeros(1, dtype=row)
    for parameter, default in zip(program.parameters, start_parameters(program), strict=True):
        sent[parameter.name] = default
    first = program.outputs[0]
    link.reset()
    for k in range(steps):
        measurement[k] = model.read()[0]
        if told is not None:
            sent[roles[0]] = told[k]
        if roles[1]:
            sent[roles[1]] = to_raw(inputs[roles[1]], measurement[k : k + 1])
        for name, value in zip(states, model.state, strict=bool(states)):
            sent[name] = to_raw(inputs[name], np.array([value]))
        answers[k] = np.frombuffer(link.step(sent.tobytes(), 1), kind)[0]
        model.apply(to_physical(first, answers[f"out_{first.name}"][k : k + 1]))
    answers["ticks"] = 0  # time, not a result
    return LoopRun(
        reference=np.asarray(reference, dtype=np.float64),
        measurement=measurement,
        command=to_physical(first, answers[f"out_{first.name}"]),
        status=answers["status"].copy(),
        raw=answers,
    )


def _delay(plant: Plant, constants: Array) -> float:
    names = [parameter.name for parameter in plant.parameters]
    return float(constants[names.index(plant.delay)]) if plant.delay is not None else 0.0
