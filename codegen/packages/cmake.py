"""CMake: the controller as a library to add, to install or to give to ESP-IDF, and its golden vectors as a test."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import CONTRACT, FLAGS, VERSION, Delivery
from firmloop.codegen.environment import render

# Targets that every build by CMake has (policy CMP0037).
_RESERVED = frozenset("all clean edit_cache help install package rebuild_cache test".split())


def cmake(delivery: Delivery) -> Mapping[str, str]:
    """Return `CMakeLists.txt`."""
    name = delivery.program.name
    view: dict[str, object] = {
        "name": name,
        "target": f"{name}_controller" if name in _RESERVED else name,
        "command": delivery.command,
        "version": VERSION,
        "sources": " ".join(f'"{source}"' for source in delivery.sources),
        "headers": " ".join(delivery.headers),
        "contract": CONTRACT,
        "flags": " ".join(FLAGS[1:]),  # CMake has a word of its own for the standard
    }
    return {"CMakeLists.txt": render("packages/CMakeLists.txt.j2", view)}


FILES = cmake
