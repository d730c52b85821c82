"""Write down what was proven of a Program: for every operation its range, its word, its margin and the argument."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.quantize.free_state import free_state
from firmloop.quantize.program import Op, Program, Table, Value

ARGUMENTS = {
    "clamp": "saturates: the result is limited to this range whatever comes in",
    "min": "saturates from above at a limit of the law",
    "max": "saturates from below at a limit of the law",
    "copy": "a constant",
    "select": "the union of both branches",
    "solve": "none: what follows limits the moves",
    "improve": "none: what follows limits the moves",
    "move": "none: what follows limits it",
    "rows": "interval: the sum of the ranges of its parts, each rounded",
    "row": "interval: the sum of the ranges of its parts, each rounded",
    "tree": "limits: every move is limited; the sums fit from the table and the ranges",
    "sweeps": "sums: the largest magnitudes of their parts, from the table and the ranges; the moves are limited",
}
INTERVAL = "interval: the rule of the operation applied to the ranges of its operands"
TRUTH = "a truth value"
PRODUCTS = ("mul_shift", "mul_add", "mul_add_short", "mul_down", "wide", "mac")  # of 64 bits


def proof(program: Program, why: Mapping[str, str]) -> Mapping[str, object]:
    """Return proof.json.

    Parameters
    ----------
    why
        the controller's own argument for the range of each state variable, by its name

    `margin` is the factor by which a value could grow before it left its word; null in floating point. In fixed point
    `low` and `high` are raw. What holds in step k: if every state variable is in its range before the step, every
    operation is in its range, and every state variable is in its range after it; `unset` names the one that is at the
    least value of its type instead until the first sample. Inputs may hold any value of their type. It holds at first:
    `start` is in the range of the state, or the least value of its type where the state is `unset` (null: no number).
    `safe` of an output, in floating point, is what it is where the last of `status` tells that an input is not a
    number; the state then stays, and no other bit is set.
    `any_state`, in fixed point: while state words hold anything at all, every operation still fits its word, in the
    range of this list where it stands there, else in its own; and outputs and next states keep their ranges.
    Each of `parameters` is a state that a step keeps, within its range; its setter takes the values from `low` to
    `high`, no others.
    """
    return {
        "schema": 1,
        "program_id": program.id,
        "name": program.name,
        "arithmetic": program.arithmetic,
        "period_s": program.period,
        "rounds": program.rounds,
        "inputs": [_value(v) for v in program.inputs],
        "tables": [_table(table) for table in program.tables],
        "routines": [_routine(routine) for routine in program.routines],
        "state": [
            _value(v) | {"start": _finite(x), "why": why[v.name]}
            for v, x in zip(program.state, program.start, strict=True)
        ],
        "unset": program.unset,
        "parameters": [
            {"name": v.name, "low": v.low, "high": v.high, "start": x}
            for v, x in zip(program.parameters, program.start[len(program.start) - len(program.tunable) :], strict=True)
        ],
        "operations": [_operation(op) for op in program.body],
        **_any_state(program),
        "next_state": [{"state": a.target, "value": a.source} for a in program.next_state],
        "outputs": [_output(program, k) for k in range(len(program.outputs))],
        "status": [{"name": b.name, "bit": b.bit, "value": b.source} for b in program.status],
        "rounding": [{"output": r.output, "bound": _finite(r.bound), "unit": r.unit} for r in program.rounding],
    }


def _any_state(program: Program) -> dict[str, object]:
    if not program.arithmetic.startswith("fixed"):
        return {}
    found = free_state(program, [value.name for value in program.state])
    assert not found.harmed, f"{found.harmed} is harmed by a state word that holds anything"
    wider = [
        {"name": op.result.name, "low": low, "high": high}
        for op, (low, high) in zip(program.body, found.ranges.values(), strict=True)
        if low < op.result.low or high > op.result.high
    ]
    return {"any_state": wider}


def _value(value: Value) -> dict[str, object]:
    return {
        "name": value.name,
        "unit": value.unit,
        "kind": value.number.kind,
        "bits": value.number.bits,
        "fraction": value.number.fraction,
        "low": _finite(value.low),
        "high": _finite(value.high),
    }


def _output(program: Program, k: int) -> dict[str, object]:
    safe = {"safe": program.safe[k]} if program.safe else {}
    return _value(program.outputs[k]) | {"value": program.results[k].source} | safe


def _table(table: Table) -> dict[str, object]:
    return {
        "name": table.name,
        "form": table.form,
        "support": table.support,
        "sizes": dict(table.sizes),
        "numbers": dict(table.numbers),
    }


def _routine(routine: Program) -> dict[str, object]:
    """Say what a routine computes; nothing is claimed of its ranges, for what calls it limits what comes out."""
    return {
        "name": routine.name,
        "inputs": [v.name for v in routine.inputs],
        "operations": [_operation(op) for op in routine.body],
        "results": [a.source for a in routine.results],
    }


def _operation(op: Op) -> dict[str, object]:
    value = op.result
    size = max(abs(value.low), abs(value.high))
    fixed = value.number.kind == "fixed"
    argument = ARGUMENTS.get(op.function, INTERVAL)
    if op.function == "move" and math.isfinite(size):
        argument = "the range of the plan"
    truth = value.low == 0 and value.high == 1 and value.number.fraction == 0 and not value.unit
    return {
        **_value(value),
        "function": op.function,
        "arguments": list(op.arguments),
        "word": value.number.bits,
        "product_word": 64 if op.function in PRODUCTS else None,
        "margin": round((2 ** (value.number.bits - 1) - 1) / size, 6) if fixed and size else None,
        "argument": TRUTH if truth else argument,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
