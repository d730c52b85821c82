"""A compilation database, for editors and clang's tools."""

from __future__ import annotations

import json
from collections.abc import Mapping

from firmloop.codegen.delivery import FLAGS, Delivery


def compile_commands(delivery: Delivery) -> Mapping[str, str]:
    """Return `compile_commands.json` of the controller and its test; the folder is where the file stands."""
    sources = (*delivery.sources, f"test/{delivery.program.name}_test.c")
    entries = [
        {"directory": ".", "file": file, "arguments": ["cc", *FLAGS, "-Isrc", "-c", file, "-o", f"{file[:-2]}.o"]}
        for file in sources
    ]
    return {"compile_commands.json": json.dumps(entries, indent=1) + "\n"}


FILES = compile_commands
