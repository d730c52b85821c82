"""Close the loop step by step: the plant in this process, the controller behind any link, the same bits on each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identify.plant import IdentifyError, Plant
from identify.stepped import SteppedPlant
from quantize.program import Program
from verify.compare import record_type
from verify.links import Link
from verify.reference import Raw, element_type, start_parameters
from verify.stimuli import to_physical, to_raw

Array = NDArray[np.float64]


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
    """What a closed-loop run needs beside the controller; `roles` are its inputs for the reference and the plant."""

    plant: Plant
    reference: Array  # one value a step
    roles: tuple[str, str]


@dataclass(frozen=True, slots=True)
class LoopCheck:
    """The run on the target, and the steps at which it is not that of the host, bit for bit."""

    run: LoopRun
    expected: LoopRun
    different: tuple[int, ...]


def check_loop(program: Program, loop: PlantLoop, host: Link, target: Link) -> LoopCheck:
    """Close the loop with the controller on the host, then on the target, and compare every step."""
    expected = close_loop(program, loop.plant, host, loop.reference, loop.roles)
    run = close_loop(program, loop.plant, target, loop.reference, loop.roles)
    both = min(len(run.raw), len(expected.raw))
    one, other = (each.measurement[:both].view("<u8") for each in (run, expected))
    bits = (one != other) | (run.raw[:both] != expected.raw[:both])
    return LoopCheck(run, expected, tuple(int(step) for step in np.flatnonzero(bits)))


def close_loop(program: Program, plant: Plant, link: Link, reference: Array, roles: tuple[str, str]) -> LoopRun:
    """Run the controller against the plant, both from their first state, one exchange over the link a step.

    Parameters
    ----------
    reference
        what the controller is told to follow, one value a step, in its unit
    roles
        names of the controller's inputs for the reference and for the plant's first output; others read zero

    A plant that grows without bound ends the run there.
    """
    model = SteppedPlant(plant, program.period)
    kind = record_type(program)
    row = np.dtype([(value.name, element_type(value.number)) for value in (*program.inputs, *program.parameters)])
    inputs = {value.name: value for value in program.inputs}
    told, measured = inputs[roles[0]], inputs[roles[1]]
    references = to_raw(told, np.asarray(reference, dtype=np.float64))
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
        sent[told.name] = references[k]
        sent[measured.name] = to_raw(measured, measurement[k : k + 1])
        answers[k] = np.frombuffer(link.step(sent.tobytes(), 1), kind)[0]
        try:
            model.apply(to_physical(first, answers[f"out_{first.name}"][k : k + 1]))
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
