"""Guard a floating-point program: what it does in a sample in which one of its inputs is not a number, or infinite.

It then commands the values of `safe`, leaves its state as it is and sets one status bit alone. The test is part of the
body, in front: a difference of an input with itself is 0, or no number, and so is its product with another. Where every
input reaches the value that the only output limits, the test is the last thing a step does, and only where that limit
acts: then a sample whose inputs are all finite mostly pays nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count

import numpy as np

from firmloop.quantize.program import Assign, Number, Op, Program, StatusBit, Value

NAME = "not_a_number"
SAYS = "an input is not a number, or infinite: the outputs are the safe ones, the state stays, and no other bit is set"
TRUTH = Number("fixed", 32, 0)
# Not finite where one operand is not, of a quotient the first; `select` where both that it chooses from are not.
PASSING = ("add", "sub", "mul", "neg", "copy", "abs", "div")


def guarded(program: Program, safe: Sequence[float | None]) -> Program:
    """Return a floating-point `program` that commands `safe` where an input is not finite.

    `safe` has one value an output, None for its low limit; empty: the low limit of each.
    """
    taken = {op.result.name for op in program.body}
    name = next(name for name in (NAME, *(f"{NAME}{k}" for k in range(2, len(taken) + 3))) if name not in taken)
    free = (f"n{k}" for k in count(1) if f"n{k}" not in taken)
    tests = _noughts(program.inputs, free)
    last = tests[-1].result.name
    limited = _limited(program)
    if limited is None:
        place = 0
        tests.append(_truth(name, "none", last))
    else:
        place = len(program.body)
        if limited.function != "outside":
            limited = _truth(next(free), "outside", *limited.arguments)
            tests.append(limited)
        tests.append(_truth(name, "none_where", limited.result.name, last))
    lowest = _low_limits(program)
    wanted = [low if x is None else x for x, low in zip(safe or lowest, lowest, strict=True)]
    rounded = np.array(wanted).astype(program.arithmetic).tolist()
    held = tuple(min(max(x, v.low), v.high) for x, v in zip(rounded, program.outputs, strict=True))
    return replace(
        program,
        body=(*program.body[:place], *tests, *program.body[place:]),
        status=(*program.status, StatusBit(NAME, SAYS, len(program.status), name)),
        safe=held,
    )


def spelled_out(program: Program) -> Program:
    """Return the same program with its guard as operations that choose, one for each output, state and status bit."""
    if not program.safe:
        return program
    guard = program.status[-1]
    chosen: list[Op] = []

    def choose(name: str, value: Value, held: str | float, source: str) -> str:
        chosen.append(Op(replace(value, name=f"guarded {name}"), "select", (guard.source, held, source)))
        return chosen[-1].result.name

    results = tuple(
        Assign(a.target, choose(f"out.{a.target}", value, safe, a.source))
        for a, value, safe in zip(program.results, program.outputs, program.safe, strict=True)
    )
    states = {value.name: value for value in program.state}
    following = tuple(
        a
        if a.source == f"self.{a.target}"
        else Assign(a.target, choose(f"next.{a.target}", states[a.target], f"self.{a.target}", a.source))
        for a in program.next_state
    )
    bits = tuple(
        replace(bit, source=choose(f"bit.{bit.name}", _truth("", "").result, 0, bit.source))
        for bit in program.status[:-1]
    )
    return replace(
        program,
        body=(*program.body, *chosen),
        results=results,
        next_state=following,
        status=(*bits, guard),
        safe=(),
    )


def _truth(name: str, function: str, *arguments: str | float) -> Op:
    return Op(Value(name, "", TRUTH, 0, 1), function, arguments)


def _noughts(inputs: Sequence[Value], free: Iterator[str]) -> list[Op]:
    """Return operations on one input more each; the last gives 0, or no number where any of them is not finite."""
    first, *others = (f"in.{value.name}" for value in inputs)
    found: list[Op] = []
    for wire in others or [first]:
        nought = Value(next(free), "", inputs[0].number, 0, 0)
        found.append(Op(nought, "nought", (found[-1].result.name if found else first, wire)))
    return found


def _low_limits(program: Program) -> tuple[float, ...]:
    """Return what each output is limited to from below."""
    made = {op.result.name: op for op in program.body}
    found = []
    for value, store in zip(program.outputs, program.results, strict=True):
        op = made.get(store.source)
        limit: str | float = value.low if op is None else op.arguments[1] if op.function == "clamp" else op.result.low
        found.append(value.low if isinstance(limit, str) else limit)
    return tuple(found)


def _limited(program: Program) -> Op | None:
    """Return what asks for, or else sets, the limits of the only output; None where an input may not reach them."""
    sources = {a.source for a in program.results}
    limit = next((op for op in program.body if op.function == "clamp" and op.result.name in sources), None)
    if limit is None or len(program.outputs) != 1:
        return None
    v, *ends = limit.arguments
    if any(isinstance(end, str) or not math.isfinite(end) for end in ends):
        return None
    if not all(v in _reached(program, f"in.{value.name}") for value in program.inputs):
        return None
    asks = (op for op in program.body if op.function == "outside" and op.arguments == limit.arguments)
    return next(asks, limit)


def _reached(program: Program, source: str) -> set[str]:
    """Return the values that are not finite wherever `source` is not."""
    lost = {source}
    for op in program.body:
        reads = op.arguments[:1] if op.function == "div" else op.arguments
        passes = op.function in PASSING and lost.intersection(map(str, reads))
        if passes or (op.function == "select" and lost.issuperset(map(str, op.arguments[1:]))):
            lost.add(op.result.name)
    return lost
