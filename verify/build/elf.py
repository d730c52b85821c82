"""Read what an image puts into memory, and check that a Cortex-M can start from it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.target import MemoryRegion, Target
from firmloop.identify.simulation.compiler import ToolError

# ELF for the Arm Architecture (IHI 0044) and the System V ABI, "Object Files": 32 bits, little-endian.
_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_PROGRAM = struct.Struct("<8I")
_IDENTITY = b"\x7fELF\x01\x01"
_LOAD = 1
EXCEPTIONS = 16  # entries of the vector table that are the core's own
BOOT_BYTES = 256  # of a second stage, in front of the vector table
CRC_POLYNOMIAL = 0x04C11DB7


@dataclass(frozen=True, slots=True)
class Segment:
    """Bytes that the image has at an address, before anything runs."""

    address: int
    data: bytes


def segments(elf: Path) -> tuple[Segment, ...]:
    """Return what has to be written into the board's memory, in order of the addresses."""
    data = elf.read_bytes()
    if len(data) < _HEADER.size or data[:6] != _IDENTITY:
        raise ToolError(f"{elf.name} is no image for a 32-bit processor: build it again")
    header = _HEADER.unpack_from(data)
    place, size, count = header[5], header[9], header[10]
    found = []
    for number in range(count):
        kind, offset, _, physical, in_file, *_ = _PROGRAM.unpack_from(data, place + number * size)
        if kind == _LOAD and in_file:
            found.append(Segment(physical, data[offset : offset + in_file]))
    return tuple(sorted(found, key=lambda segment: segment.address))


def flat(parts: Sequence[Segment]) -> Segment:
    """Return one stretch that holds all segments; what lies between them reads as erased flash."""
    first = parts[0].address
    last = max(part.address + len(part.data) for part in parts)
    memory = bytearray(b"\xff" * (last - first))
    for part in parts:
        memory[part.address - first : part.address - first + len(part.data)] = part.data
    return Segment(first, bytes(memory))


def check_start(elf: Path, target: Target) -> None:
    """Check the vector table and the initial stack pointer, and the second stage where the target has one.

    ARMv7-M Architecture Reference Manual (DDI 0403), B1.5.3: word 0 is the initial stack pointer, the others are
    addresses of handlers with bit 0 set; one that is not used is zero.

    Raises
    ------
    ToolError
        when the processor could not start from it.
    """
    regions = {region.name: region for region in target.memory}
    image = flat(segments(elf))
    if image.address != regions["flash"].start:
        raise ToolError(f"{target.name}: the image begins at {image.address:#x}, not where the flash does: rebuild it")
    skipped = BOOT_BYTES if target.boot is not None else 0
    if skipped and boot_crc(image.data[: skipped - 4]) != int.from_bytes(image.data[skipped - 4 : skipped], "little"):
        raise ToolError(f"{target.name}: the second stage does not carry its CRC, so the boot ROM would refuse it")
    stack, *handlers = struct.unpack_from(f"<{EXCEPTIONS}I", image.data, skipped)
    if not _within(stack - 1, regions["ram"]) or stack % 8:
        raise ToolError(
            f"{target.name}: the initial stack pointer {stack:#x} is not in the RAM, or not a multiple of 8"
        )
    wrong = [address for address in handlers if address and not (address & 1 and _within(address, regions["flash"]))]
    if wrong or not handlers[0] or not handlers[2]:
        raise ToolError(f"{target.name}: the vector table has no sound handler of reset and faults: {wrong}")


def boot_crc(data: bytes) -> int:
    """Return the CRC-32 that the boot ROM of an RP2040 computes (its datasheet, section 2.8.1.3.1)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = ((crc << 1) ^ (CRC_POLYNOMIAL if crc >> 31 else 0)) & 0xFFFFFFFF
    return crc


def _within(address: int, region: MemoryRegion) -> bool:
    return region.start <= address < region.start + region.size
