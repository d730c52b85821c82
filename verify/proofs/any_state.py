"""Run single steps from states anywhere in their proven ranges, beside those that inputs lead to from init().

Some states take inputs for days to be reached, others are not known to be reached at all; what the C makes of them is
compared too, with the state that it leaves. The state is drawn, and brought to the edges of limits, as if it were more
inputs. In fixed point the words of the state hold anything besides: no init(), a flipped bit, another build's flash.
Only a link into this process can set a state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.view import physical
from firmloop.quantize.not_a_number import spelled_out
from firmloop.quantize.program import Assign, Op, Program, Value
from firmloop.verify.compare import record_type
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.packing import records
from firmloop.verify.reference import Machine, Raw, element_type, working_type
from firmloop.verify.stimuli.stimuli import singles
from firmloop.verify.verdict import Difference

STEPS = 20_000
LEAST = -(2**31)  # of a state's word in fixed point
LOST = (np.nan, np.inf, -np.inf)  # a word of the state that a flipped bit has made no number
BEYOND = 4.0  # times its range on both sides, that an input is drawn from
STEPS_SOLVING = 2_000  # of a program that solves: each takes long


@dataclass(frozen=True, slots=True)
class Departures:
    """How many steps ran, in how many outputs, status words and states they differed, and the first of these."""

    steps: int
    differences: int
    first: Difference | None


@dataclass(frozen=True, slots=True)
class AnyState:
    """Columns of inputs and state, one step each, and the outputs, status and next state that belong to them."""

    columns: list[Raw]
    expected: list[Raw]


def any_state(program: Program, seed: int, steps: int) -> AnyState:
    """Draw states and inputs, for `steps` steps at most, and run the reference on them."""
    if not program.state:
        return AnyState([], [])
    program = spelled_out(program)
    step = opened(program)
    columns = _drawn(program, step, seed, steps)
    machine, kind, count = Machine(step), working_type(program), len(columns[0])
    with np.errstate(all="ignore"):
        named = machine.named(machine.step([column.astype(kind) for column in columns], []))
    ends = {a.source for a in step.results} | {b.source for b in program.status}
    return AnyState(columns, _expected(program, step, {end: np.broadcast_to(named[end], count) for end in ends}, count))


def departures(program: Program, link: LibraryLink, drawn: AnyState) -> Departures:
    """Compare the C with the reference, bit for bit."""
    if not drawn.columns:
        return Departures(0, 0, None)
    got = _stepped(program, link, drawn.columns)
    wrong = np.stack([_apart(a, b) for a, b in zip(drawn.expected, got, strict=True)])
    return Departures(wrong.shape[1], int(np.count_nonzero(wrong)), _first(program, drawn, got, wrong))


def _first(program: Program, drawn: AnyState, got: list[Raw], wrong: NDArray[np.bool_]) -> Difference | None:
    if not wrong.any():
        return None
    names = [v.name for v in program.outputs] + ["status"] + [f"self.{v.name}" for v in program.state]
    units = [v.unit for v in program.outputs] + ["status bits"] + [v.unit for v in program.state]
    step = int(np.argmax(wrong.any(axis=0)))
    j = int(np.argmax(wrong[:, step]))
    places = zip((*program.inputs, *program.state), drawn.columns, strict=True)
    read = ", ".join(f"{v.name} = {physical(float(column[step]), v.number):.9g}" for v, column in places)
    return Difference(
        step=step,
        lane=f"any state, step {step}",
        output=names[j],
        expected=float(drawn.expected[j][step]),
        got=float(got[j][step]),
        unit=units[j],
        operation=f"one step from {read}",
    )


def opened(program: Program) -> Program:
    """Return one step of the program with its state among inputs and outputs: `self_x` for the state x."""
    renamed = {f"self.{v.name}": f"in.self_{v.name}" for v in program.state}
    body = tuple(
        Op(op.result, op.function, tuple(renamed.get(a, a) if isinstance(a, str) else a for a in op.arguments))
        for op in program.body
    )
    state = tuple(replace(v, name=f"self_{v.name}") for v in _left(program))
    stores = tuple(Assign(f"self_{a.target}", renamed.get(a.source, a.source)) for a in program.next_state)
    return replace(
        program,
        inputs=(*program.inputs, *state),
        outputs=(*program.outputs, *state),
        state=(),
        start=(),
        body=body,
        next_state=(),
        results=tuple(replace(a, source=renamed.get(a.source, a.source)) for a in (*program.results, *stores)),
        unset=None,
        tunable=(),
    )


def _left(program: Program) -> list[Value]:
    """Return the state with the range of what init() or a step leaves there."""
    results = {op.result.name: op.result for op in program.body}
    seen = [abs(end) for value in (*program.inputs, *program.outputs) for end in (value.low, value.high)]
    far = BEYOND * max((end for end in seen if np.isfinite(end)), default=1.0)
    found = []
    for value, store, start in zip(program.state, program.next_state, program.start, strict=True):
        assert store.target == value.name
        made, first = results.get(store.source, value), value.low if value.name == program.unset else start
        low, high = max(value.low, min(made.low, first)), min(value.high, max(made.high, first))
        # A state without a bound, as an integral has none where nothing stops it, is drawn from about the signals'.
        ends = (low if np.isfinite(low) else -far, high if np.isfinite(high) else far)
        found.append(replace(value, low=ends[0], high=ends[1]))
    return found


def _drawn(program: Program, step: Program, seed: int, steps: int) -> list[Raw]:
    """Return columns of inputs and state, one step each, the state within its ranges and never -0.

    The same inputs come a second time, with random bits in every word of the state, or with words that are no numbers.
    """
    steps = min(steps, STEPS_SOLVING if program.solves else STEPS)
    blocks = singles(step, steps, seed)
    if not program.arithmetic.startswith("fixed"):  # which takes inputs from beyond their ranges too
        blocks = [*blocks, *singles(replace(step, inputs=tuple(map(_beyond, step.inputs))), steps, seed)]
    rows = [np.moveaxis(block.inputs, -1, 0).reshape(len(step.inputs), -1) for block in blocks]
    columns = [np.concatenate(parts) for parts in zip(*rows, strict=True)]
    for j, value in enumerate(step.inputs[len(program.inputs) :], len(program.inputs)):
        inside = (columns[j] >= value.low) & (columns[j] <= value.high)
        columns[j] = np.where(inside, columns[j], np.array(_middle(value), columns[j].dtype)) + columns[j].dtype.type(0)
    random, count, given = np.random.default_rng(seed), len(columns[0]), len(program.inputs)
    if program.arithmetic.startswith("fixed"):
        words = random.integers(LEAST, -LEAST, size=(len(program.state), count), dtype=np.int64)
        held = [*columns[:given], *words.astype(np.int32)]
    else:
        lost = random.choice(LOST, size=(len(program.state), count))
        kept = random.random(lost.shape) < random.random(count)  # from no word to all of them
        held = [*columns[:given], *(np.where(k, x, y) for k, x, y in zip(kept, columns[given:], lost, strict=True))]
    return [np.concatenate([one, other.astype(one.dtype)]) for one, other in zip(columns, held, strict=True)]


def _beyond(value: Value) -> Value:
    reach = BEYOND * (value.high - value.low)
    return replace(value, low=value.low - reach, high=value.high + reach)


def _middle(value: Value) -> float:
    low, high = (x if np.isfinite(x) else 0.0 for x in (value.low, value.high))
    return float(np.floor((low + high) / 2)) if value.number.kind == "fixed" else (low + high) / 2


def _expected(program: Program, step: Program, slots: dict[str, Raw], count: int) -> list[Raw]:
    """Return the columns of outputs, status and next states as the C holds them."""
    outputs = [slots[a.source] for a in step.results]
    status = np.zeros(count, np.uint32)
    for bit in program.status:
        status |= slots[bit.source].astype(np.uint32) << np.uint32(bit.bit)
    kinds = [element_type(v.number) for v in (*program.outputs, *program.state)]
    typed = [values.astype(kind) for values, kind in zip(outputs, kinds, strict=True)]
    return [*typed[: len(program.outputs)], status, *typed[len(program.outputs) :]]


def _stepped(program: Program, link: LibraryLink, columns: list[Raw]) -> list[Raw]:
    """Return the same columns, as the C answers."""
    many, first = len(program.inputs), len(program.inputs) + len(program.state) - len(program.tunable)
    memory = np.zeros(len(columns[0]), [(v.name, element_type(v.number)) for v in program.state])
    for value, column in zip(program.state, columns[many:], strict=True):
        memory[value.name] = column
    typed = [
        column.astype(element_type(v.number))
        for v, column in zip((*program.inputs, *program.state), columns, strict=True)
    ]
    inputs, asked = np.stack(typed[:many], axis=-1), np.stack(typed[first:], axis=-1) if program.tunable else None
    answers, after = link.step_from(memory.tobytes(), memory.itemsize, records(program, inputs, asked), len(memory))
    got = np.frombuffer(answers, dtype=record_type(program))
    left = np.frombuffer(after, dtype=memory.dtype)
    outputs = [got[f"out_{v.name}"] for v in program.outputs]
    return [*outputs, got["status"], *(left[v.name] for v in program.state)]


def _apart(one: Raw, other: Raw) -> NDArray[np.bool_]:
    """Tell where two columns differ in a bit; any two that are no number are alike."""
    bits = f"<u{one.dtype.itemsize}"
    lost = (one != one) & (other != other)
    return np.asarray((np.ascontiguousarray(one).view(bits) != np.ascontiguousarray(other).view(bits)) & ~lost)
