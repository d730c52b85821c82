"""CMake: the controller as a library to add, to install or to give to ESP-IDF, and its golden vectors as a test."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import CONTRACT, FLAGS, VERSION, Delivery
from firmloop.codegen.environment import render


def cmake(delivery: Delivery) -> Mapping[str, str]:
    """Return `CMakeLists.txt`."""
    view: dict[str, object] = {
        "name": delivery.program.name,
        "command": delivery.command,
        "version": VERSION,
        "sources": " ".join(f'"{source}"' for source in delivery.sources),
        "headers": " ".join(delivery.headers),
        "contract": CONTRACT,
        "flags": " ".join(FLAGS[1:]),  # CMake has a word of its own for the standard
    }
    return {"CMakeLists.txt": render("packages/CMakeLists.txt.j2", view)}


FILES = cmake
