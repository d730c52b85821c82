"""Build a controller for this machine: as a library to load, and as a program under the sanitizers."""

from __future__ import annotations

import struct
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from codegen.bundle import Bundle, write_files
from codegen.host import host_files
from codegen.target import Target
from identify.compiler import ToolError, run_compiler, shared_library
from quantize.program import Program
from verify.compare import record_type
from verify.reference import Trace
from verify.settings import records
from verify.stimuli import Block

WARNINGS = tuple(
    "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Werror".split()
)
FLAGS = (*WARNINGS, "-O2", "-ffp-contract=off")
SANITIZERS = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-O1", "-g")
SANITIZER_TIME = 300.0  # s


def build_host(bundle: Bundle, target: Target) -> Path:
    """Return the library of a bundle, compiled with every warning an error."""
    return shared_library(host_files(bundle), (*bundle.sources, "host.c"), (*FLAGS, *target.flags))


def run_sanitized(program: Program, bundle: Bundle, block: Block, trace: Trace) -> int:
    """Run a block as a program under the undefined-behavior and address sanitizers; return how many steps agreed.

    Raises
    ------
    ToolError
        when a sanitizer stops the program; its first words are in the message. Zero steps are returned where this
        compiler has no sanitizers.
    """
    lanes, steps, _ = block.inputs.shape
    data = struct.pack("<II", lanes, steps) + records(program, block.inputs, block.settings)
    with tempfile.TemporaryDirectory(prefix="firmloop-") as name:
        folder = Path(name)
        write_files(host_files(bundle), folder)
        sources = (*bundle.sources, "host.c", "host_main.c")
        try:
            run_compiler(["gcc", *WARNINGS, "-ffp-contract=off", *SANITIZERS, "-o", "sanitized", *sources], folder)
        except ToolError as error:
            if "-lasan" in str(error) or "-lubsan" in str(error):
                return 0
            raise
        done = subprocess.run(
            [str(folder / "sanitized")], input=data, capture_output=True, timeout=SANITIZER_TIME, check=False
        )
    if done.returncode != 0:
        words = done.stderr.decode(errors="replace").strip().splitlines()
        first = "; ".join(line.strip() for line in words[:3]) or f"status {done.returncode}"
        raise ToolError(f"the sanitizers stopped {bundle.name}: {first}")
    got = np.frombuffer(done.stdout, dtype=record_type(program)).reshape(lanes, steps)
    return int(_agree(program, trace, got).sum())


def _agree(program: Program, trace: Trace, got: Any) -> Any:
    same = trace.status == got["status"]
    for j, value in enumerate(program.outputs):
        same &= trace.outputs[..., j] == got[f"out_{value.name}"]
    return same


def total_steps(blocks: Sequence[Block]) -> int:
    """Return the number of steps in all blocks."""
    return sum(b.inputs.shape[0] * b.inputs.shape[1] for b in blocks)
