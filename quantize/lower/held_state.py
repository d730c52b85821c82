"""Make a program defined from every state: cut a state word to its range as it is read, if harm could come.

A state word may hold anything: init() was not called, a bit has flipped, the state was restored from a flash of another
build. In fixed point no operation may overflow then, and one step later all is in its range again. In floating point
nothing overflows, and a state that is lost starts afresh; only what nobody computes anew, a parameter, is limited.

A state that was limited as it is stored is limited as it is read instead: the same operation at the same cost, and what
is computed from the state is the same. Of any other state, the range is all that a number of some bits can hold, so the
word is read as a number of these bits: one instruction on most cores, and no change to a state in its range. A
parameter has a range of its own, is limited to it, and stored as it is then. Where nothing is harmed, the word is read
as it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from firmloop.quantize.free_state import LEAST, free_state
from firmloop.quantize.program import Op, Program, Value

SHORT = 40  # operations: the kinds' examples up to 33 gain on a Cortex-M4 and an M3, those from 51 on do not


def from_any_state(program: Program) -> Program:
    """Return a fixed-point `program` that every state word leaves defined and that is in its ranges one step later."""
    program, cut = _limited_when_read(program)
    free = [v.name for v in program.state if v.name not in cut]
    harmful = [name for name in free if free_state(program, (name,)).harmed]
    while harmful:
        program = _cut(program, {f"self.{v.name}": _as_held(v) for v in program.state if v.name in harmful})
        cut |= set(harmful)
        harmed = free_state(program, [v.name for v in program.state]).harmed
        harmful = [name for name in _fed_by(program, harmed) if name not in cut]
    return _read_first(program, {f"self.{name}" for name in cut})


def with_limited_parameters(program: Program) -> Program:
    """Return a floating-point `program` that limits its parameters as it reads them; one that is no number is low."""
    return _cut(program, {f"self.{v.name}": _as_limited(v) for v in program.parameters})


def _read_first(program: Program, cut: set[str]) -> Program:
    """Put what brings states into their ranges in front of a short program: a compiler loads the state at once then.

    In a long one, words that are read long before they are used would be pushed out of the registers again.
    """
    if len(program.body) > SHORT:
        return program
    first = [op for op in program.body if _reads(op, cut)]
    return replace(program, body=(*first, *(op for op in program.body if not _reads(op, cut))))


def _reads(op: Op, cut: set[str]) -> bool:
    """Tell whether an operation asks for the first sample, or reads a state that is brought into its range."""
    return op.arguments[0] in cut or (op.function == "eq" and op.arguments[1:] == (LEAST,))


def _limited_when_read(program: Program) -> tuple[Program, set[str]]:
    """Limit each state that is limited to its range as it is stored as it is read instead, and name these states."""
    made = {op.result.name: op for op in program.body}
    reads = Counter(_read(program))
    moved: dict[str, Op] = {}  # state: what makes it
    for value, store in zip(program.state, program.next_state, strict=True):
        op = made.get(store.source)
        limits = op is not None and (op.function, op.arguments[1:]) == ("clamp", (value.low, value.high))
        before = made.get(str(op.arguments[0])) if op is not None and limits else None
        if before is None or reads[store.source] > 1 or (value.name == program.unset and before.result.low <= LEAST):
            continue
        moved[value.name] = before
    program = _cut(program, {f"self.{v.name}": _as_limited(v) for v in program.state if v.name in moved})
    state = []
    for value, start in zip(program.state, program.start, strict=True):
        if value.name in moved:
            left, first = moved[value.name].result, value.low if value.name == program.unset else start
            value = replace(value, low=min(left.low, first), high=max(left.high, first))
        state.append(value)
    dropped = {a.source for a in program.next_state if a.target in moved}
    following = [replace(a, source=moved[a.target].result.name) if a.target in moved else a for a in program.next_state]
    body = tuple(op for op in program.body if op.result.name not in dropped)
    return replace(program, body=body, next_state=tuple(following), state=tuple(state)), set(moved)


def _read(program: Program) -> list[str]:
    """Return the name of every value that is read, as often as it is."""
    arguments = [a for op in program.body for a in op.arguments if isinstance(a, str)]
    stored = [a.source for a in (*program.next_state, *program.results)]
    return [*arguments, *stored, *(bit.source for bit in program.status)]


def _cut(program: Program, held: Mapping[str, Op]) -> Program:
    """Bring states into their ranges right before they are first read, but for the test of the first sample.

    `held` gives for each, by the name that operations read it by, the operation that does.
    """
    taken = {op.result.name for op in program.body}
    called = {name: _free_name(op.result.name, taken) for name, op in held.items()}
    ends = (*program.next_state, *program.results)
    body: list[Op] = []
    placed: set[str | int | float] = set()
    for op in (*program.body, None):
        if op is not None and op.function == "eq" and op.arguments[1:] == (LEAST,):
            body.append(op)
            continue
        for name in op.arguments if op is not None else [end.source for end in ends]:
            if name in held and name not in placed:
                op_of = held[str(name)]
                body.append(replace(op_of, result=replace(op_of.result, name=called[str(name)])))
                placed.add(name)
        if op is not None:
            arguments = tuple(called.get(a, a) if isinstance(a, str) else a for a in op.arguments)
            body.append(replace(op, arguments=arguments))
    return replace(
        program,
        body=tuple(body),
        next_state=tuple(replace(a, source=called.get(a.source, a.source)) for a in program.next_state),
        results=tuple(replace(a, source=called.get(a.source, a.source)) for a in program.results),
    )


def _as_held(value: Value) -> Op:
    """Return the operation that leaves a word as it is in the range of `value`, and brings any other into it."""
    bits = int(value.high).bit_length()
    if (value.low, value.high) == (-(1 << bits), (1 << bits) - 1):
        return Op(replace(value, name=f"{value.name}_held"), "wrap", (f"self.{value.name}", 31 - bits))
    return _as_limited(value)


def _as_limited(value: Value) -> Op:
    ends = (value.low, value.high) if value.number.kind == "float" else (int(value.low), int(value.high))
    return Op(replace(value, name=f"{value.name}_held"), "clamp", (f"self.{value.name}", *ends))


def _free_name(wish: str, taken: set[str]) -> str:
    name = next(name for name in (wish, *(f"{wish}{k}" for k in range(2, len(taken) + 3))) if name not in taken)
    taken.add(name)
    return name


def _fed_by(program: Program, harmed: str) -> set[str]:
    """Return the states that the value `harmed` is computed from."""
    found = {harmed}
    for op in reversed(program.body):
        if op.result.name in found:
            found.update(a for a in op.arguments if isinstance(a, str))
    return {name.removeprefix("self.") for name in found if name.startswith("self.")}
