"""Check that a RISC-V can start: its first instruction is the first word of the image."""

from __future__ import annotations

from firmloop.codegen.target import Target
from firmloop.identify.simulation.compiler import ToolError
from firmloop.verify.build.elf import Segment


def check(image: Segment, entry: int, target: Target) -> None:
    """Check where the image is entered; a RISC-V has no vector table, it starts at an address of the chip's."""
    if entry != image.address:
        raise ToolError(
            f"{target.name}: the image is entered at {entry:#x}, but the core starts at {image.address:#x}: rebuild it"
        )
