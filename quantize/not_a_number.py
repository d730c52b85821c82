"""Guard a floating-point program: what it does in a sample in which one of its inputs is not a number.

It then commands the values of `safe`, leaves its state as it is and sets one status bit alone. The test is part of the
body. Where every input reaches the value that the only output limits, a test of that value comes first, which the
limit asks anyway: then a sample whose inputs are all numbers mostly pays nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from firmloop.quantize.program import Assign, Number, Op, Program, StatusBit, Value

NAME = "not_a_number"
SAYS = "an input is not a number: the outputs are the safe ones, the state stays, and no other bit is set"
TRUTH = Number("fixed", 32, 0)
# Not a number where one operand is not; `select` where both that it chooses from are not.
PASSING = ("add", "sub", "mul", "neg", "copy", "abs", "div")


def guarded(program: Program, safe: Sequence[float | None]) -> Program:
    """Return a floating-point `program` that commands `safe` where an input is not a number.

    `safe` has one value an output, None for its low limit; empty: the low limit of each.
    """
    taken = {op.result.name for op in program.body}
    name = next(name for name in (NAME, *(f"{NAME}{k}" for k in range(2, len(taken) + 3))) if name not in taken)
    asks = [f"in.{value.name}" for value in program.inputs]
    limit = _limit(program)
    if limit is not None and len(asks) <= 2:
        place, limited = limit
        tests = [_truth(name, "unordered_below", *limited, asks[0], asks[-1])]
    else:
        place, tests = 0, _tests(asks, name, taken)
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
        if a.target in program.tunable
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


def _tests(asks: Sequence[str], name: str, taken: set[str]) -> list[Op]:
    """Return operations that ask two inputs at a time; the last is called `name`."""
    found: list[Op] = []
    free = (f"n{k}" for k in range(1, 2 * len(asks) + len(taken) + 2) if f"n{k}" not in taken)
    for k in range(0, len(asks), 2):
        pair = asks[k : k + 2]
        found.append(_truth(next(free), "unordered", pair[0], pair[-1]))
        if k:
            found.append(_truth(next(free), "or", found[-2].result.name, found[-1].result.name))
    found[-1] = replace(found[-1], result=replace(found[-1].result, name=name))
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


def _limit(program: Program) -> tuple[int, tuple[str, float]] | None:
    """Return where the only output is limited first, what is limited there and the low limit; None where not so."""
    sources = {a.source for a in program.results}
    limit = next((op for op in program.body if op.function == "clamp" and op.result.name in sources), None)
    if limit is None or len(program.outputs) != 1:
        return None
    v, low, _ = limit.arguments
    if not isinstance(v, str) or isinstance(low, str):
        return None
    if not all(v in _reached(program, f"in.{value.name}") for value in program.inputs):
        return None
    place = next(k for k, op in enumerate(program.body) if op.arguments[:2] == (v, low))
    return place, (v, low)


def _reached(program: Program, source: str) -> set[str]:
    """Return the values that are not a number wherever `source` is not."""
    lost = {source}
    for op in program.body:
        passes = op.function in PASSING and lost.intersection(map(str, op.arguments))
        if passes or (op.function == "select" and lost.issuperset(map(str, op.arguments[1:]))):
            lost.add(op.result.name)
    return lost
