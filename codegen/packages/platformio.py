"""PlatformIO: a library of any framework, built with the flags that the proof holds for."""

from __future__ import annotations

import json
from collections.abc import Mapping

from firmloop.codegen.delivery import CONTRACT, VERSION, Delivery


def platformio(delivery: Delivery) -> Mapping[str, str]:
    """Return `library.json`."""
    manifest = {
        "name": delivery.program.name,
        "version": VERSION,
        "description": delivery.says,
        "keywords": ["control"],
        "frameworks": "*",
        "platforms": "*",
        "headers": [f"{delivery.program.name}.h"],
        "build": {"srcDir": "src", "includeDir": "src", "flags": [CONTRACT]},
    }
    return {"library.json": json.dumps(manifest, indent=2) + "\n"}


FILES = platformio
