"""Run a Program bit for bit, many controllers at once: one operation on all lanes per Program operation and sample.

numpy gives each operation its meaning; what takes many steps runs in compiled code of the same operations, where this
machine has a compiler and knows them all (`verify/lanes`; a test compares the two).
Values have the shape (lanes,): a lane is one controller with its own inputs. Fixed point runs in int64 (all values
are proven to fit 32 bits, products 64), floating point in its own type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.not_a_number import spelled_out
from firmloop.quantize.ops import EVERY
from firmloop.quantize.program import Number, Program, Value
from firmloop.quantize.twins.qp import Rows
from firmloop.verify.lanes.compiled import Compiled, RowStep, library, runs
from firmloop.verify.lanes.plans import Improved, known_as, with_plans

Raw = NDArray[Any]
AT_ONCE = 4096  # lanes: 32 kB a value
MANY = 2000  # steps of all lanes; fewer take numpy less time than building the compiled code once


@dataclass(frozen=True, slots=True)
class Trace:
    """A run: outputs (lanes, steps, r), status (lanes, steps), state before each step (lanes, steps, n)."""

    outputs: Raw
    status: NDArray[np.uint32]
    state: Raw


def element_type(number: Number) -> np.dtype[Any]:
    """Return the numpy type of a struct member of this format."""
    return np.dtype(f"<{'f' if number.kind == 'float' else 'i'}{number.bits // 8}")


def working_type(program: Program) -> np.dtype[Any]:
    """Return the numpy type in which the program's values are computed."""
    return np.dtype({"float32": "f4", "float64": "f8"}.get(program.arithmetic, "i8"))


def start_state(program: Program, lanes: int) -> list[Raw]:
    """Return the state that init() sets, one array (lanes,) per state variable."""
    kind = working_type(program)
    return [np.full(lanes, x, dtype=kind) for x in program.start]


def start_parameters(program: Program) -> Raw:
    """Return what init() sets the parameters that can be tuned to, (k,)."""
    first = len(program.start) - len(program.tunable)
    kind = element_type(program.parameters[0].number) if program.tunable else working_type(program)
    return np.array(program.start[first:], dtype=kind)


def set_parameter(value: Value, held: Raw, asked: Raw) -> Raw:
    """Do what a parameter's setter does: return `asked` where that is in its range, else `held`."""
    return np.where((asked >= value.low) & (asked <= value.high), asked, held)


class Machine:
    """A Program made ready to run: every operand resolved to a slot once."""

    def __init__(self, program: Program) -> None:
        program = spelled_out(program)
        self.program = program
        kind = working_type(program)
        self.slots: dict[str, int] = {}
        for value in program.inputs:
            self._slot(f"in.{value.name}")
        for value in program.state:
            self._slot(f"self.{value.name}")
        self.constants: dict[int, Any] = {}
        self.steps: list[tuple[Any, int, tuple[int, ...], tuple[Any, ...]]] = []
        self.rows: list[RowStep] = []
        for table in program.tables:
            self._slot(f"table.{table.name}")
        tables = {f"table.{table.name}": table for table in program.tables}
        models = {f"routine.{routine.name}": Machine(routine) for routine in program.routines}
        for name, model in models.items():
            self.constants[self._slot(name)] = model.call
        self.solved: dict[int, tuple[Any, Machine | None]] = {}  # programs, and the model of what is nonlinear
        for op in program.body:
            operation = EVERY[op.function]
            places, shifts = [], []
            for k, argument in enumerate(op.arguments):
                if argument in tables:
                    assert operation.table is not None
                    slot = self.slots[str(argument)]
                    self.constants[slot] = operation.table(tables[str(argument)], kind)
                    places.append(slot)
                elif isinstance(argument, str):
                    places.append(self.slots[argument])
                elif k in operation.whole:
                    shifts.append(int(argument))
                else:
                    slot = self._slot(f"#{len(self.slots)}")
                    self.constants[slot] = kind.type(argument)
                    places.append(slot)
            self.steps.append((operation.run, self._slot(op.result.name), tuple(places), tuple(shifts)))
            if op.function == "improve":
                self.solved[self.steps[-1][1]] = self.constants[places[0]], models[str(op.arguments[1])]
                places = places[2:]
            elif op.function == "solve":
                self.solved[self.steps[-1][1]] = self.constants[places[0]], None
                places = places[1:]
            self.rows.append(RowStep(op.function, self.steps[-1][1], tuple(places), tuple(shifts)))
        models_too = all(model is None or model.compilable for _, model in self.solved.values())
        self.compilable: bool = models_too and runs(kind, [known_as(step) for step in self.rows])
        self.inputs = [self.slots[f"in.{v.name}"] for v in program.inputs]
        self.state = [self.slots[f"self.{v.name}"] for v in program.state]
        self.next = [self.slots[a.source] for a in program.next_state]
        self.results = [self.slots[a.source] for a in program.results]
        self.status = [(self.slots[b.source], b.bit) for b in program.status]

    def _slot(self, name: str) -> int:
        return self.slots.setdefault(name, len(self.slots))

    def call(self, inputs: Sequence[Raw]) -> list[Any]:
        """Compute the results of a program without state."""
        values = self.step(list(inputs), [])
        return [values[slot] for slot in self.results]

    def step(self, inputs: list[Raw], state: list[Raw]) -> list[Any]:
        """Compute one sample of every lane and return all values by slot."""
        values: list[Any] = [None] * len(self.slots)
        for slot, constant in self.constants.items():
            values[slot] = constant
        for slot, value in zip(self.inputs, inputs, strict=True):
            values[slot] = value
        for slot, value in zip(self.state, state, strict=True):
            values[slot] = value
        for run, target, places, shifts in self.steps:
            values[target] = run(*[values[p] for p in places], *shifts)
        return values

    def compiled(self) -> Compiled | None:
        """Return the program ready to run in compiled code; None where that does not know one of its operations."""
        return self._compiled(self.next, self.results, self.status, len(self.program.tunable))

    def asked(self, names: Sequence[str]) -> Compiled | None:
        """Return what computes the values of these names in compiled code; None where that does not know it all."""
        return self._compiled(self.next or self.state, [self.slots[name] for name in names])

    def _compiled(
        self, following: Sequence[int], results: Sequence[int], bits: Sequence[tuple[int, int]] = (), tuned: int = 0
    ) -> Compiled | None:
        code = library() if self.compilable else None
        if code is None:
            return None
        plans: dict[int, Rows | Improved] = {}
        for slot, (program, model) in self.solved.items():
            ready = None if model is None else model.compiled()
            plans[slot] = program if ready is None else (program, ready)
        numbers = {slot: value for slot, value in self.constants.items() if np.isscalar(value)}
        steps, constants = with_plans(self.rows, numbers, len(self.slots), plans)
        ends = (self.inputs, self.state, following, results, bits)
        return Compiled(code, working_type(self.program), steps, constants, *ends, tuned)

    def watch(self, names: Sequence[str]) -> Callable[[list[Raw], list[Raw]], list[Any]]:
        """Return what computes one sample of every lane, as `step` does, but perhaps only the values of these names."""
        ready = self.asked(names)
        if ready is None:
            return self.step
        slots, kind = [self.slots[name] for name in names], working_type(self.program)

        def watched(inputs: list[Raw], state: list[Raw]) -> list[Any]:
            found = ready.results(np.stack(inputs)[None], np.array(state, dtype=kind))
            values: list[Any] = [None] * len(self.slots)
            for slot, value in zip(slots, found[0], strict=True):
                values[slot] = value
            return values

        return watched

    @cached_property
    def after(self) -> Callable[[list[Raw], list[Raw]], list[Raw]]:
        """What computes the state after one sample of every lane, one array (lanes,) per variable."""
        watched = self.watch([a.source for a in self.program.next_state])

        def after(inputs: list[Raw], state: list[Raw]) -> list[Raw]:
            with np.errstate(all="ignore"):
                return self.following(watched(inputs, state), len(inputs[0]))

        return after

    def following(self, values: list[Any], lanes: int) -> list[Raw]:
        """Return the state after a step, one array (lanes,) per variable."""
        found = [values[slot] for slot in self.next]
        return [x if np.shape(x) == (lanes,) else np.broadcast_to(x, lanes) for x in found]

    def named(self, values: list[Any]) -> Mapping[str, Any]:
        """Return the values of one step by name."""
        return {name: values[slot] for name, slot in self.slots.items() if not name.startswith("#")}


def run(program: Program, inputs: Raw, settings: Raw | None = None, start: Sequence[Raw] | None = None) -> Trace:
    """Run `program` on raw `inputs` (lanes, steps, m), each lane a controller of its own.

    `settings` (lanes, steps, k) is what the setter of each parameter is called with before each step; None: none is.
    `start` is the state, one array (lanes,) per variable; None is the one that init() sets.
    """
    lanes, steps, width = inputs.shape
    if not program.state and steps > 1:  # no step knows of another: all at once
        at_once = run(program, inputs.reshape(lanes * steps, 1, width))
        return Trace(
            at_once.outputs.reshape(lanes, steps, -1),
            at_once.status.reshape(lanes, steps),
            at_once.state.reshape(lanes, steps, -1),
        )
    machine = Machine(program)
    if lanes * steps >= MANY:
        ready = machine.compiled()
        if ready is not None:
            return _run_compiled(program, ready, inputs, settings, start)
    kind = working_type(program)
    first = len(program.state) - len(program.tunable)
    begin = start_state(program, lanes) if start is None else [x.astype(kind) for x in start]
    outputs = np.empty((steps, len(program.outputs), lanes), dtype=_member_type(program))
    before = np.empty((steps, len(program.state), lanes), dtype=kind)
    status = np.zeros((steps, lanes), dtype=np.uint32)
    with np.errstate(all="ignore"):
        for part in parts(lanes):
            columns = np.ascontiguousarray(np.moveaxis(inputs[part], (1, 2), (0, 1)), kind)  # (steps, m, lanes)
            asked = () if settings is None else np.moveaxis(settings[part], (1, 2), (0, 1)).astype(kind)
            state = [x[part] for x in begin]
            for k in range(steps):
                for j, parameter in enumerate(program.parameters if len(asked) else ()):
                    state[first + j] = set_parameter(parameter, state[first + j], asked[k][j])
                for j, value in enumerate(state):
                    before[k, j, part] = value
                values = machine.step(list(columns[k]), state)
                state = machine.following(values, columns.shape[2])
                for j, slot in enumerate(machine.results):
                    outputs[k, j, part] = values[slot]
                for slot, bit in machine.status:
                    status[k, part] |= np.asarray(values[slot]).astype(np.uint32) << np.uint32(bit)
    return Trace(np.moveaxis(outputs, 2, 0), np.moveaxis(status, 1, 0), np.moveaxis(before, 2, 0))


def _run_compiled(
    program: Program, ready: Compiled, inputs: Raw, settings: Raw | None, start: Sequence[Raw] | None
) -> Trace:
    """Run `program` as `run` does."""
    lanes, steps, _ = inputs.shape
    kind = working_type(program)
    begin = np.array(start_state(program, lanes) if start is None else start, dtype=kind)
    trace = Trace(
        np.empty((lanes, steps, len(program.outputs)), dtype=_member_type(program)),
        np.zeros((lanes, steps), dtype=np.uint32),
        np.empty((lanes, steps, len(program.state)), dtype=kind),
    )
    asked, ranges = None, np.array([(v.low, v.high) for v in program.parameters], dtype=kind)
    if settings is not None:
        asked = np.moveaxis(settings, 0, 2)
    views = (np.moveaxis(trace.outputs, 0, 2), trace.status.T, np.moveaxis(trace.state, 0, 2))
    ready.run(np.moveaxis(inputs, 0, 2), begin, *views, asked, ranges)
    return trace


def parts(whole: int, at_once: int = AT_ONCE) -> list[slice]:
    """Return lanes in parts whose values stay in the processor's cache from one operation to the next."""
    return [slice(begin, min(begin + at_once, whole)) for begin in range(0, whole, at_once)]


def _member_type(program: Program) -> np.dtype[Any]:
    return element_type(program.outputs[0].number) if program.outputs else working_type(program)
