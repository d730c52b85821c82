"""A test in C that runs the golden vectors through the controller and compares every bit."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import Delivery, Raw
from firmloop.codegen.environment import render
from firmloop.codegen.view import c_type, setter_name
from firmloop.quantize.program import Program, Value


def vector_test(delivery: Delivery) -> Mapping[str, str]:
    """Return `test/<name>_test.c`, which has the only main() of the folder."""
    name = delivery.program.name
    view: dict[str, object] = {"name": name, "command": delivery.command, **_test_view(delivery)}
    return {f"test/{name}_test.c": render("vectors_test.c.j2", view)}


def _test_view(delivery: Delivery) -> dict[str, object]:
    """Return what the test prints; floats travel as their bits, so that a NaN or a negative zero is told apart."""
    program = delivery.program
    number = program.inputs[0].number if program.inputs else program.outputs[0].number
    floating = number.kind == "float"
    raw = f"uint{number.bits}_t" if floating else "int32_t"
    rows = [
        f"{{ {{ {_joined(row_in, row_set)} }}, {{ {_cells(row_out)} }}, {word}U, {start}U }},"
        for start, row_in, row_set, row_out, word in delivery.rows()
    ]
    return {
        "raw": raw,
        "rows": rows,
        "count": len(rows),
        "inputs": (*program.inputs, *program.parameters),
        "outputs": program.outputs,
        "loads": [_load(v, k) for k, v in enumerate(program.inputs)],
        "parameters": [_parameter(program, v, k) for k, v in enumerate(program.parameters, len(program.inputs))],
        "checks": [_check(v, k, raw) for k, v in enumerate(program.outputs)],
        "floating_says": "Floats stand in it as their bits." if floating else "Values stand in it as raw integers.",
    }


def _load(value: Value, place: int) -> str:
    if value.number.kind == "float":
        return f"memcpy(&in.{value.name}, &row->in[{place}], sizeof in.{value.name});"
    return f"in.{value.name} = (int{value.number.bits}_t)row->in[{place}];"


def _parameter(program: Program, value: Value, place: int) -> Mapping[str, str]:
    """Return what a row does to one parameter."""
    if value.number.kind == "float":
        load = f"memcpy(&{value.name}, &row->in[{place}], sizeof {value.name});"
    else:
        load = f"{value.name} = row->in[{place}];"
    call = f"(void){setter_name(program, value)}(&controller, {value.name});"
    return {"declare": f"{c_type(value.number)} {value.name};", "load": load, "call": call}


def _joined(inputs: Raw, settings: Raw) -> str:
    return ", ".join(text for text in (_cells(inputs), _cells(settings)) if text)


def _check(value: Value, place: int, raw: str) -> Mapping[str, str]:
    if value.number.kind == "float":
        differs = f"memcmp(&out.{value.name}, &{value.name}_expected, sizeof out.{value.name}) != 0"
    else:
        differs = f"out.{value.name} != {value.name}_expected"
    return {
        "name": value.name,
        "differs": differs,
        "compute": f"const {raw} {value.name}_expected = row->out[{place}];",
    }


def _cells(row: Raw) -> str:
    if row.dtype.kind == "f":
        bits = row.view(f"u{row.dtype.itemsize}")
        return ", ".join(
            f"0x{int(x):0{2 * row.dtype.itemsize}x}{'ULL' if row.dtype.itemsize == 8 else 'U'}" for x in bits
        )
    return ", ".join(str(int(x)) if int(x) != -(2**31) else "-2147483647 - 1" for x in row)


FILES = vector_test
