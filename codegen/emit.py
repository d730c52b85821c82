"""Print a Program as C99: one header, one source, one support header, and the manifest that describes them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version

from firmloop.codegen.bundle import Bundle, CodegenError
from firmloop.codegen.environment import render, text_of
from firmloop.codegen.names import check_identifier, made_of
from firmloop.codegen.view import c_type, physical, program_view, setter_name, supports_of
from firmloop.quantize.program import Program, Value


def emit(program: Program, command: str) -> Bundle:
    """Return the C of a program; the same program and command give the same bytes.

    `command` is the command line that makes it again; it is printed in a comment.

    Raises
    ------
    CodegenError
        when a name cannot be a C identifier.
    """
    _check_names(program)
    view = program_view(program, tool_version(), command)
    supports = with_included((*supports_of(program), *(table.support for table in program.tables)))
    files = {
        f"{program.name}.h": render("controller.h.j2", view),
        f"{program.name}.c": render("controller.c.j2", view),
        **{support: text_of(f"support/{support}") for support in supports},
    }
    setters = tuple((c_type(v.number), setter_name(program, v)) for v in program.parameters)
    headers = (f"{program.name}.h", *supports)
    return Bundle(program.name, program.id, files, (f"{program.name}.c",), headers, setters)


def with_included(names: Sequence[str]) -> tuple[str, ...]:
    """Return support files, each with those of ours that it includes behind it."""
    return tuple(
        further
        for name in names
        for further in (
            name,
            *with_included(re.findall(r'^#include "(.+)"$', text_of(f"support/{name}"), flags=re.MULTILINE)),
        )
    )


def manifest(program: Program, bundle: Bundle) -> Mapping[str, object]:
    """Return manifest.json: what was generated, below the folder that it lies in, and how the structs are laid out."""
    folder = f"{program.name}/src"
    return {
        "schema": 1,
        "name": program.name,
        "program_id": program.id,
        "period_s": program.period,
        "arithmetic": program.arithmetic,
        "sources": [f"{folder}/{name}" for name in bundle.sources],
        "headers": [f"{folder}/{name}" for name in bundle.headers],
        "include_dirs": [folder],
        "inputs": [_entry(v) for v in program.inputs],
        "outputs": [_entry(v) for v in program.outputs],
        "state": [_entry(v) for v in program.state],
        "parameters": [
            _entry(v) | {"default": physical(x, v.number), "setter": setter_name(program, v)}
            for v, x in zip(program.parameters, program.start[len(program.start) - len(program.tunable) :], strict=True)
        ],
        "status": [{"name": b.name, "bit": b.bit, "says": b.says} for b in program.status],
        "rounding": {
            r.output: {"bound": r.bound if math.isfinite(r.bound) else None, "unit": r.unit} for r in program.rounding
        },
    }


def _entry(value: Value) -> dict[str, object]:
    low, high = physical(value.low, value.number), physical(value.high, value.number)
    return {
        "name": value.name,
        "unit": value.unit,
        "type": c_type(value.number),
        "fraction_bits": value.number.fraction if value.number.kind == "fixed" else None,
        "low": low if math.isfinite(low) else None,
        "high": high if math.isfinite(high) else None,
    }


def _check_names(program: Program) -> None:
    check_identifier(program.name, "project name")
    own = {*made_of(program.name), *(setter_name(program, v) for v in program.parameters)}
    for value in (*program.inputs, *program.outputs, *program.state):
        check_identifier(value.name, "signal")
        if value.name in own:
            raise CodegenError(f"signal {value.name!r} is a name the generated code uses: choose another name")
    for kind, values in (("input", program.inputs), ("output", program.outputs)):
        names = [v.name for v in values]
        for name in names:
            if names.count(name) > 1:
                raise CodegenError(f"{kind} {name!r} appears twice: every signal needs its own name")


def tool_version() -> str:
    """Return which firmloop this is."""
    try:
        return version("firmloop")
    except PackageNotFoundError:  # run from the tree without an installation
        return "from source"
