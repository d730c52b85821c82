"""Check that a Cortex-M can start: its vector table and its initial stack pointer."""

from __future__ import annotations

import struct

from firmloop.codegen.target import MemoryRegion, Target
from firmloop.identify.simulation.compiler import ToolError
from firmloop.verify.build.elf import Segment

EXCEPTIONS = 16  # entries of the vector table that are the core's own


def check(image: Segment, entry: int, target: Target) -> None:
    """Check the vector table that `image` begins with.

    ARMv7-M Architecture Reference Manual (DDI 0403), B1.5.3: word 0 is the initial stack pointer, the others are
    addresses of handlers with bit 0 set; one that is not used is zero.
    """
    regions = {region.name: region for region in target.memory}
    stack, *handlers = struct.unpack_from(f"<{EXCEPTIONS}I", image.data)
    if not _within(stack - 1, regions["ram"]) or stack % 8:
        raise ToolError(
            f"{target.name}: the initial stack pointer {stack:#x} is not in the RAM, or not a multiple of 8"
        )
    wrong = [address for address in handlers if address and not (address & 1 and _within(address, regions["flash"]))]
    if wrong or not handlers[0] or not handlers[2]:
        raise ToolError(f"{target.name}: the vector table has no sound handler of reset and faults: {wrong}")
    if entry != handlers[0]:
        raise ToolError(f"{target.name}: the image is entered at {entry:#x}, reset at {handlers[0]:#x}: rebuild it")


def _within(address: int, region: MemoryRegion) -> bool:
    return region.start <= address < region.start + region.size
