"""Close the loop step by step: the plant in this process, the controller behind any link, the same bits on each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.stepped import SteppedPlant
from firmloop.quantize.program import Program, Value
from firmloop.verify.compare import record_type
from firmloop.verify.link import Link
from firmloop.verify.reference import Raw, element_type, start_parameters
from firmloop.verify.scaling import to_physical, to_raw
from firmloop.verify.verdict import EQUATIONS

Array = NDArray[np.float64]


class Stepped(Protocol):
    """A plant from rest that takes its inputs once a period."""

    def read(self) -> Array:
        """Return the outputs (r,) before the next input acts."""

    def apply(self, values: Array) -> None:
        """Hold the inputs (m,) for one period; IdentifyError where the plant cannot go on."""


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
    """What a closed-loop run needs beside the controller.

    `roles` are the controller's inputs for the reference and for the plant's first output, empty where nothing has it;
    `others` further inputs, each with the number of the output that it carries. What is none of these reads zero.
    What moves is the plant by its own equations, or what `begin` makes of a period, s, and `says` names: then there may
    be no plant, and every output of the controller drives it.
    """

    plant: Plant | None
    reference: Array  # one value a step, in its unit
    roles: tuple[str, str]
    others: tuple[tuple[str, int], ...] = ()
    begin: Callable[[float], Stepped] | None = None
    says: str = EQUATIONS

    def start(self, period: float) -> Stepped:
        """Return what moves, from rest, with a period in s.

        Raises
        ------
        IdentifyError
            when it cannot be moved step by step.
        """
        if self.begin is not None:
            return self.begin(period)
        assert self.plant is not None, "what has no plant says how it begins"
        return SteppedPlant(self.plant, period)

    def driven_by(self, program: Program) -> tuple[Value, ...]:
        """Return the controller's outputs that drive it."""
        return program.outputs if self.plant is None else program.outputs[: len(self.plant.inputs)]


@dataclass(frozen=True, slots=True)
class LoopCheck:
    """The run on the target, and the steps at which it is not that of the host, bit for bit."""

    run: LoopRun
    expected: LoopRun
    different: tuple[int, ...]
    says: str = EQUATIONS


def check_loop(program: Program, loop: PlantLoop, host: Link, target: Link) -> LoopCheck:
    """Close the loop with the controller on the host, then on the target, and compare every step."""
    expected, run = (close_loop(program, loop, link) for link in (host, target))
    both = min(len(run.raw), len(expected.raw))
    one, other = (each.measurement[:both].view("<u8") for each in (run, expected))
    bits = (one != other) | (run.raw[:both] != expected.raw[:both])
    return LoopCheck(run, expected, tuple(int(step) for step in np.flatnonzero(bits)), loop.says)


def close_loop(program: Program, loop: PlantLoop, link: Link) -> LoopRun:
    """Run the controller against the plant, both from their first state, one exchange over the link a step.

    A plant that grows without bound ends the run there.
    """
    model, reference = loop.start(program.period), loop.reference
    kind = record_type(program)
    row = np.dtype([(value.name, element_type(value.number)) for value in (*program.inputs, *program.parameters)])
    inputs = {value.name: value for value in program.inputs}
    measured = [(inputs[name], output) for name, output in ((loop.roles[1], 0), *loop.others) if name]
    told = inputs.get(loop.roles[0])
    references = None if told is None else to_raw(told, np.asarray(reference, dtype=np.float64))
    steps = len(reference)
    measurement = np.empty(steps)
    answers = np.empty(steps, dtype=kind)
    sent = np.zeros(1, dtype=row)
    for parameter, default in zip(program.parameters, start_parameters(program), strict=True):
        sent[parameter.name] = default
    driving = loop.driven_by(program)
    first = driving[0]
    link.reset()
    for k in range(steps):
        seen = model.read()
        measurement[k] = seen[0]
        if told is not None and references is not None:
            sent[told.name] = references[k]
        for value, output in measured:
            sent[value.name] = to_raw(value, seen[output : output + 1])
        answers[k] = np.frombuffer(link.step(sent.tobytes(), 1), kind)[0]
        try:
            drives = [to_physical(value, answers[f"out_{value.name}"][k : k + 1]) for value in driving]
            model.apply(np.concatenate(drives))
        except IdentifyError:
            reference, measurement, answers = reference[: k + 1], measurement[: k + 1], answers[: k + 1]
            break
    answers["ticks"] = 0  # time, not a result
    return LoopRun(
        reference=np.asarray(reference, dtype=np.float64),
        measurement=measurement,
        command=to_physical(first, answers[f"out_{first.name}"]),
        status=answers["status"].copy(),
        raw=answers,
    )
