"""Rust: a crate without the standard library, whose build compiles the C and whose only file wraps it safely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from firmloop.codegen.delivery import FLAGS, VERSION, Delivery
from firmloop.codegen.environment import render
from firmloop.codegen.view import c_type, setter_name
from firmloop.quantize.program import Value

_TYPES = {"float": "f32", "double": "f64", "int16_t": "i16", "int32_t": "i32"}
_NEVER = ("crate", "self", "super", "Self")  # that no mark turns into a name


def rust(delivery: Delivery) -> Mapping[str, str]:
    """Return `Cargo.toml`, `rust/build.rs` and `rust/lib.rs`."""
    program = delivery.program
    state = _members(program.state) or [{"name": "unused", "type": "i32", "note": ""}]  # as in C
    view: dict[str, object] = {
        "name": program.name,
        "command": delivery.command,
        "says": delivery.says,
        "period": repr(program.period),
        "sources": ", ".join(f'"{name.removesuffix(".c")}"' for name in delivery.bundle.sources),
        "flags": ", ".join(f'"{flag}"' for flag in (*FLAGS, "-fPIC")),
        "inputs": _members(program.inputs),
        "outputs": _members(program.outputs),
        "state": state,
        "status": [{"macro": each.name.upper(), "mask": 1 << each.bit, "says": each.says} for each in program.status],
        "parameters": [
            {
                "name": value.name,
                "type": _TYPES[c_type(value.number)],
                "setter": setter_name(program, value),
                "function": f"set_{value.name}",
            }
            for value in program.parameters
        ],
    }
    manifest = (
        "[package]",
        f'name = "{program.name}"',
        f'version = "{VERSION}"',
        'edition = "2021"',
        'build = "rust/build.rs"',
        f'links = "{program.name}_c"',
        "",
        "[lib]",
        'path = "rust/lib.rs"',
        "",
    )
    return {
        "Cargo.toml": "\n".join(manifest),
        "rust/build.rs": render("packages/build.rs.j2", view),
        "rust/lib.rs": render("packages/lib.rs.j2", view),
    }


def _members(values: Sequence[Value]) -> list[Mapping[str, str]]:
    return [
        {
            "name": f"{value.name}_" if value.name in _NEVER else f"r#{value.name}",
            "type": _TYPES[c_type(value.number)],
            "note": _note(value),
        }
        for value in values
    ]


def _note(value: Value) -> str:
    if value.number.kind == "float":
        return value.unit or "1"
    return f"{value.unit or '1'}, physical = raw / 2^{value.number.fraction}"


FILES = rust
