"""Play a controller again on what it was given: bit for bit as it is, and quickly with other figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.design.law import Law
from firmloop.design.models.anti_windup import MODES
from firmloop.identify.signal import Signal
from firmloop.quantize.program import Program
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical, to_raw

Array = NDArray[np.float64]
Table = Mapping[str, object]
# ([controller] table, period in s, range of the output, None as in [signals]) -> law; None where the kind refuses.
Rebuild = Callable[[Table, float, tuple[float, float] | None], Law | None]

WINDUP = tuple(MODES)  # ways of anti-windup that a controller may have been run with, the usual one first
_UNLIMITED = "unlimited"  # what a law calls its output before the limits


@dataclass(frozen=True, slots=True)
class Controller:
    """A controller with every figure it was made from: `program` is exact, `law` the same in real numbers.

    `table` is [controller] with its gains as numbers; `defaults` are those keys of it that follow from the others where
    they are left out, `tuned` those that a rule has found. `wires` are the places of reference and measurement among
    its inputs.
    """

    law: Law
    program: Program
    table: Table
    defaults: tuple[str, ...]
    tuned: tuple[str, ...]
    wires: tuple[int, int]
    rebuild: Rebuild

    @property
    def period(self) -> float:
        """Sample time, s."""
        return self.law.period

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Signals that it reads, in its order."""
        return self.law.inputs

    @property
    def output(self) -> Signal:
        """Its first output, which drives the plant."""
        return self.law.outputs[0]

    @property
    def start(self) -> Array:
        """State (s,) that init() sets."""
        return np.array(self.law.start, dtype=np.float64)

    @property
    def running(self) -> Array:
        """State (s,) in the middle of a run, as far as it is known: the first sample is over."""
        names = [signal.name for signal in self.law.state]
        return np.where([name == self.law.opening for name in names], 1.0, self.start)


def play(law: Law, inputs: Array, start: Array) -> Array:
    """Return the first output (n,) of a law, in float64, for inputs (n, m) from state `start` (s,)."""
    answer: Array = np.asarray(_course(law, inputs, start)[1], dtype=np.float64)[0]
    return answer


def play_unlimited(law: Law, inputs: Array, start: Array) -> Array | None:
    """Return what the first output (n,) is before its limits; None where the law does not tell."""
    names = [signal.name for signal in law.last.named]
    if _UNLIMITED not in names:
        return None
    free: Array = np.asarray(_course(law, inputs, start)[3], dtype=np.float64)[names.index(_UNLIMITED)]
    return free


def play_exactly(controller: Controller, inputs: Array, start: Array) -> Array:
    """Return the first output (n,) of the program, bit for bit, for inputs (n, m) from the law's state `start` (s,).

    From init() where that is the start. The program holds no other state before its first sample, so that anywhere else
    the law answers the first row.
    """
    law, program = controller.law, controller.program
    raw = np.stack([to_raw(value, column) for value, column in zip(program.inputs, inputs.T, strict=True)], axis=-1)
    if np.array_equal(start, controller.start):
        return to_physical(program.outputs[0], run(program, raw[None]).outputs[0, :, 0])
    after, first = _course(law, inputs[:1], start)[:2]
    held = dict(zip((signal.name for signal in law.state), np.asarray(after, dtype=np.float64)[:, 0], strict=True))
    begin = [to_raw(value, held[value.name][None]) for value in program.state]
    rest = run(program, raw[None, 1:], None, begin).outputs[0, :, 0]
    return np.concatenate([np.asarray(first, dtype=np.float64)[0], to_physical(program.outputs[0], rest)])


def _course(law: Law, inputs: Array, start: Array) -> list[object]:
    assert len(law.stages) == 1
    return list(law.last.function.mapaccum("course", len(inputs))(start, inputs.T))
