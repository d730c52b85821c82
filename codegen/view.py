"""Flatten a Program into what the two controller templates may see: strings, ready to print."""

from __future__ import annotations

import math
import re
import textwrap
from dataclasses import replace

import numpy as np

from firmloop.quantize.ops import EVERY
from firmloop.quantize.program import Number, Op, Program, StatusBit, Table, Value

View = dict[str, object]

NUMBER_SAYS = {
    "float32": "single precision, round to nearest, no fused multiply-add (compile with -ffp-contract=off)",
    "float64": "double precision, round to nearest, no fused multiply-add (compile with -ffp-contract=off)",
    "fixed32": "32-bit fixed point, 64-bit products, saturating, rounding {rounds}; no overflow, proven",
    "fixed16": "16-bit fixed-point signals on 32-bit values, saturating, rounding {rounds}; no overflow, proven",
}
ROUNDS_SAYS = {"nearest": "to nearest", "floor": "down"}
INPUT_SAYS = {
    "float": "Where one is not finite, the safe outputs are commanded and the state stays",
    "fixed": "Every value of the type is allowed",
}
PLACES = {"in": "in->", "self": "self->", "table": "", "routine": ""}
WHOLE = Number("fixed", 32, 0)
LINE = 100  # characters of a table's line


def c_type(number: Number) -> str:
    """Return the C type of a struct member: float, double, int16_t or int32_t."""
    if number.kind == "float":
        return "float" if number.bits == 32 else "double"
    return f"int{number.bits}_t"


def literal(value: float, number: Number) -> str:
    """Return a C constant of exactly this value.

    >>> literal(-5, Number("fixed", 32, 0)), literal(-2**31, Number("fixed", 32, 0))
    ('(-5)', '(-2147483647 - 1)')
    >>> literal(np.float32(0.1), Number("float", 32, 0)), literal(2.0, Number("float", 64, 0))
    ('0.1F', '2.0')
    """
    if number.kind == "float" and math.isnan(value):
        return f"fl_unset_f{number.bits}()"
    if number.kind == "fixed":
        raw = int(value)
        if raw == -(2**31):
            return "(-2147483647 - 1)"
        return str(raw) if raw >= 0 else f"({raw})"
    text = str(np.float32(value)) if number.bits == 32 else repr(float(value))
    suffix = "F" if number.bits == 32 else ""
    return f"{text}{suffix}" if not text.startswith("-") else f"({text}{suffix})"


def program_view(program: Program, version: str, command: str) -> View:
    """Return everything the header and the source of a controller print."""
    macro = program.name.upper()
    last = len(program.status) - 1
    state = [_member(v) for v in program.state]
    start = [
        {"name": v.name, "literal": literal(x, v.number)} for v, x in zip(program.state, program.start, strict=True)
    ]
    if not state:  # C has no empty struct
        state = [{"name": "unused", "type": "int32_t", "note": "this controller has no state"}]
        start = [{"name": "unused", "literal": "0"}]
    floating = program.arithmetic.startswith("float")
    guard = 1 + next((k for k, op in enumerate(program.body) if _guards(op, program)), len(program.body) - 1)
    return {
        "name": program.name,
        "says": program.says,
        "version": version,
        "command": command,
        "macro": macro,
        "program_id": program.id,
        "period": repr(program.period),
        "number_says": NUMBER_SAYS[program.arithmetic].format(rounds=ROUNDS_SAYS[program.rounds]),
        "input_says": INPUT_SAYS["float" if floating else "fixed"],
        "supports": supports_of(program),
        "rounding": [
            {"output": r.output, "bound": f"{r.bound:.3g}", "unit": r.unit}
            for r in program.rounding
            if math.isfinite(r.bound)
        ],
        "fractions": [
            {"macro": v.name.upper(), "name": v.name, "fraction": v.number.fraction}
            for v in (*program.inputs, *program.outputs, *program.parameters)
            if not floating
        ],
        "status": [
            {"macro": b.name.upper(), "mask": 1 << b.bit, "says": b.says, "comma": "," if k < last else ""}
            for k, b in enumerate(program.status)
        ],
        "inputs": [_member(v) for v in program.inputs],
        "outputs": [_member(v) for v in program.outputs],
        "state": state,
        "state_bytes": sum(v.number.bits // 8 for v in program.state) or 4,
        "start": start,
        "tables": [_table(table, program) for table in program.tables],
        "routines": [_routine(routine) for routine in program.routines],
        "parameters": _parameters(program),
        "lines": [_line(op, program) for op in program.body[:guard]],
        "guard": _guard(program, macro),
        "guarded_lines": [_line(op, program) for op in program.body[guard:]],
        "stores": _stores(program),
        "ignored": [] if program.state else ["self"],
        "status_expression": " | ".join(_status_term(b.source, b.bit) for b in _open_bits(program)) or "0U",
    }


def supports_of(program: Program) -> list[str]:
    """Return the headers with the C of a program's operations, each once, that of every program first."""
    bodies = [op for each in (program, *program.routines) for op in each.body]
    own = sorted({EVERY[op.function].support for op in bodies} - {""})
    return ["fl_float.h" if program.arithmetic.startswith("float") else "fl_fixed.h", *own]


KEPT = ""
STORED_AGAIN = "\n *  Not for an interrupt that can cut into step(), which stores the value again, within its range."


def setter_name(program: Program, parameter: Value) -> str:
    """Return the name of the C function that sets a parameter."""
    return f"{program.name}_set_{parameter.name}"


def _parameters(program: Program) -> list[dict[str, str]]:
    """Return what the parameters that can be tuned print: macros of default and range, and a setter each."""
    first = len(program.state) - len(program.tunable)
    return [
        {
            "name": value.name,
            "macro": f"{program.name}_{value.name}".upper(),
            "type": c_type(value.number),
            "setter": setter_name(program, value),
            "default": literal(program.start[first + k], value.number),
            "low": literal(value.low, value.number),
            "high": literal(value.high, value.number),
            "note": _member(value)["note"],
            "default_note": f"{physical(program.start[first + k], value.number):.6g} {value.unit or '1'}",
            "keeping": KEPT if program.next_state[first + k].source == f"self.{value.name}" else STORED_AGAIN,
        }
        for k, value in enumerate(program.parameters)
    ]


def statement(op: Op, program: Program) -> str:
    """Return the C statement of one operation, as the source prints it."""
    line = _line(op, program)
    return f"{line['name']} = {line['expression']}"


def _member(value: Value) -> dict[str, str]:
    low, high = physical(value.low, value.number), physical(value.high, value.number)
    q = f", Q{value.number.fraction}" if value.number.kind == "fixed" else ""
    span = f", {low:.6g} to {high:.6g}" if math.isfinite(low) and math.isfinite(high) else ""
    return {"name": value.name, "type": c_type(value.number), "note": f"{value.unit or '1'}{q}{span}"}


def physical(raw: float, number: Number) -> float:
    """Return the physical value of a raw one."""
    return raw * 2.0**-number.fraction


def _line(op: Op, program: Program) -> dict[str, str]:
    operation = EVERY[op.function]
    style = "fixed" if program.arithmetic.startswith("fixed") or op.function in ("and", "or", "not") else ""
    form = operation.c[style or program.arithmetic]
    number = op.result.number
    operand = _literal_number(op, program)
    whole = Number("fixed", 32, 0)
    texts = [_argument(a, whole if k in operation.whole else operand) for k, a in enumerate(op.arguments)]
    if operation.truth:
        note = "truth"
    else:
        low, high = physical(op.result.low, number), physical(op.result.high, number)
        q = f"Q{number.fraction}, " if number.kind == "fixed" else ""
        unit = f"{op.result.unit}, " if op.result.unit else ""
        note = f"{unit}{q}{low:.6g} to {high:.6g}"
    kind = operation.record or c_type(number)
    expression = re.sub(
        r"(?<=, )\((-[^()]+)\)(?=[,)])|(?<=\()\((-[^()]+)\)(?=[,)])",
        r"\1\2",
        form.format(*texts, rest=", ".join(texts[1:]), others=", ".join(texts[2:])),
    )
    return {"name": op.result.name, "type": kind, "expression": expression, "note": note}


def _table(table: Table, program: Program) -> dict[str, object]:
    floating = program.arithmetic.startswith("float")
    number = Number("float", int(program.arithmetic[5:]), 0) if floating else Number("fixed", 32, 0)
    fields = []
    for name, values in table.numbers:
        numbers = values if isinstance(values, tuple) else (values,)
        text = ", ".join(literal(x, WHOLE if isinstance(x, int) else number).strip("()") for x in numbers)
        if isinstance(values, tuple):
            text = f"{{ {text} }}"
        fields.append({"name": name, "lines": textwrap.wrap(f"{text},", LINE, break_on_hyphens=False)})
    return {
        "name": table.name,
        "says": table.says,
        "form": table.form,
        "support": table.support,
        "number": c_type(number),
        "sizes": ", ".join(f"{name} = {size}" for name, size in table.sizes),
        "fields": fields,
    }


def _routine(program: Program) -> dict[str, object]:
    """Return what a routine prints: its arguments and results are arrays, and nothing is said of ranges."""
    place = {f"in.{value.name}": f"both[{k}]" for k, value in enumerate(program.inputs)}
    body = [replace(op, arguments=tuple(place.get(str(a), a) for a in op.arguments)) for op in program.body]
    results = [place.get(a.source, a.source) for a in program.results]
    return {
        "name": program.name,
        "says": program.says,
        "lines": [_line(op, program) | {"note": op.result.unit} for op in body],
        "stores": [{"target": f"found[{k}]", "source": source} for k, source in enumerate(results)],
    }


def _literal_number(op: Op, program: Program) -> Number:
    """Return the type a literal argument of this operation has."""
    if program.arithmetic.startswith("float") and op.function not in ("and", "or", "not"):
        return Number("float", int(program.arithmetic[5:]), 0)
    return Number("fixed", 32, 0)


def _argument(argument: str | int | float, number: Number) -> str:
    if not isinstance(argument, str):
        return literal(argument, number)
    place, dot, member = argument.partition(".")
    return f"{PLACES[place]}{member}" if dot else argument


def _stores(program: Program) -> list[dict[str, str]]:
    types = {v.name: c_type(v.number) for v in program.outputs}
    states = [
        {"target": f"self->{a.target}", "source": _argument(a.source, TYPE_INT)}
        for a in program.next_state
        if a.source != f"self.{a.target}"  # a parameter that a step leaves alone
    ]
    outputs = []
    for a in program.results:
        source = _argument(a.source, TYPE_INT)
        outputs.append(
            {"target": f"out->{a.target}", "source": f"(int16_t){source}" if types[a.target] == "int16_t" else source}
        )
    return outputs + states


def _open_bits(program: Program) -> tuple[StatusBit, ...]:
    """Return the status bits that a step can set that has not ended before."""
    return program.status[:-1] if program.safe else program.status


TYPE_INT = Number("fixed", 32, 0)


def _guards(op: Op, program: Program) -> bool:
    return bool(program.safe) and op.result.name == program.status[-1].source


def _guard(program: Program, macro: str) -> dict[str, object] | None:
    """Return what a step does, and then ends, where an input is not finite; None where the format has no such."""
    if not program.safe:
        return None
    bit = program.status[-1]
    return {
        "test": bit.source,
        "stores": [
            {"target": f"out->{v.name}", "literal": literal(x, v.number)}
            for v, x in zip(program.outputs, program.safe, strict=True)
        ],
        "status": f"(uint32_t){macro}_{bit.name.upper()}",
    }


def _status_term(source: str, bit: int) -> str:
    return f"(uint32_t){source}" if bit == 0 else f"((uint32_t){source} << {bit}U)"
