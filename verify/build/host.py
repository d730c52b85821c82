"""Build a controller for this machine, as a library to load."""

from __future__ import annotations

from pathlib import Path

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.host import host_files
from firmloop.codegen.target import Target
from firmloop.identify.simulation.compiler import shared_library

WARNINGS = tuple(
    "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Werror".split()
)
FLAGS = (*WARNINGS, "-O2", "-ffp-contract=off")


def build_host(bundle: Bundle, target: Target) -> Path:
    """Return the library of a bundle, compiled with every warning an error."""
    return shared_library(host_files(bundle), (*bundle.sources, "host.c"), (*FLAGS, *target.flags))
