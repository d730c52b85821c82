"""CMake: the controller as a library, and its golden vectors as a test."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import FLAGS, Delivery
from firmloop.codegen.environment import render


def cmake(delivery: Delivery) -> Mapping[str, str]:
    """Return `CMakeLists.txt`."""
    view: dict[str, object] = {
        "name": delivery.program.name,
        "command": delivery.command,
        "sources": " ".join(delivery.bundle.sources),
        "flags": " ".join(FLAGS[1:]),  # CMake has a word of its own for the standard
    }
    return {"CMakeLists.txt": render("CMakeLists.txt.j2", view)}


FILES = cmake
