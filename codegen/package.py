"""Print what a user's build needs beside the C: golden vectors, a test that runs them, CMake and clang files."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.environment import render
from firmloop.codegen.view import c_type, setter_name
from firmloop.quantize.program import Program, Value

Raw = NDArray[Any]

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-ffp-contract=off")


def package(
    program: Program, bundle: Bundle, command: str, inputs: Raw, settings: Raw, outputs: Raw, status: NDArray[np.uint32]
) -> Mapping[str, str]:
    """Return `vectors.csv`, `<name>_test.c`, `CMakeLists.txt` and `compile_commands.json`.

    `inputs` (lanes, steps, m), `settings` (lanes, steps, k) what each parameter is asked to be before the step,
    `outputs` (lanes, steps, r), `status` (lanes, steps): raw values as the reference computed them, each lane from
    init(); `command` is the command line that makes the files again.
    """
    shared: dict[str, object] = {"name": program.name, "command": command}
    sources = " ".join(bundle.sources)
    return {
        "vectors.csv": vectors(program, inputs, settings, outputs, status),
        f"{program.name}_test.c": render(
            "vectors_test.c.j2", {**shared, **_test_view(program, inputs, settings, outputs, status)}
        ),
        "CMakeLists.txt": render("CMakeLists.txt.j2", {**shared, "sources": sources, "flags": " ".join(FLAGS[1:])}),
        "compile_commands.json": compile_commands(program, bundle),
    }


def vectors(program: Program, inputs: Raw, settings: Raw, outputs: Raw, status: NDArray[np.uint32]) -> str:
    """Return golden vectors as CSV: one row a step, integers in fixed point, hexadecimal floats in floating point.

    `start` is 1 where init() comes before the step.
    """
    names = ["start", *(v.name for v in (*program.inputs, *program.parameters, *program.outputs)), "status"]
    lines = [",".join(names)]
    for start, row_in, row_set, row_out, word in _rows(inputs, settings, outputs, status):
        cells = [_text(v, x) for v, x in zip(program.inputs, row_in, strict=True)]
        cells += [_text(v, x) for v, x in zip(program.parameters, row_set, strict=True)]
        cells += [_text(v, x) for v, x in zip(program.outputs, row_out, strict=True)]
        lines.append(",".join([str(start), *cells, str(word)]))
    return "\n".join(lines) + "\n"


def compile_commands(program: Program, bundle: Bundle) -> str:
    """Return the compilation database of the controller and its test; the folder is where the file stands."""
    files = (*bundle.sources, f"{program.name}_test.c")
    entries = [
        {"directory": ".", "file": file, "arguments": ["cc", *FLAGS, "-c", file, "-o", f"{file[:-2]}.o"]}
        for file in files
    ]
    return json.dumps(entries, indent=1) + "\n"


def _test_view(
    program: Program, inputs: Raw, settings: Raw, outputs: Raw, status: NDArray[np.uint32]
) -> dict[str, object]:
    """Return what the test prints; floats travel as their bits, so that a NaN or a negative zero is told apart."""
    number = program.inputs[0].number if program.inputs else program.outputs[0].number
    floating = number.kind == "float"
    raw = f"uint{number.bits}_t" if floating else "int32_t"
    rows = [
        f"{{ {{ {_joined(row_in, row_set)} }}, {{ {_cells(row_out)} }}, {word}U, {start}U }},"
        for start, row_in, row_set, row_out, word in _rows(inputs, settings, outputs, status)
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


def _rows(
    inputs: Raw, settings: Raw, outputs: Raw, status: NDArray[np.uint32]
) -> Iterator[tuple[int, Raw, Raw, Raw, int]]:
    for lane in range(len(inputs)):
        for step in range(inputs.shape[1]):
            yield int(step == 0), inputs[lane, step], settings[lane, step], outputs[lane, step], int(status[lane, step])


def _text(value: Value, x: Any) -> str:
    return float(x).hex() if value.number.kind == "float" else str(int(x))


def _cells(row: Raw) -> str:
    if row.dtype.kind == "f":
        bits = row.view(f"u{row.dtype.itemsize}")
        return ", ".join(
            f"0x{int(x):0{2 * row.dtype.itemsize}x}{'ULL' if row.dtype.itemsize == 8 else 'U'}" for x in bits
        )
    return ", ".join(str(int(x)) if int(x) != -(2**31) else "-2147483647 - 1" for x in row)
