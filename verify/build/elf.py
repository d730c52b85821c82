"""Read what an image puts into memory, and where it is entered."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.identify.simulation.compiler import ToolError

# System V ABI, "Object Files": 32 bits, little-endian.
_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_PROGRAM = struct.Struct("<8I")
_IDENTITY = b"\x7fELF\x01\x01"
_LOAD = 1


@dataclass(frozen=True, slots=True)
class Segment:
    """Bytes that the image has at an address, before anything runs."""

    address: int
    data: bytes


def segments(elf: Path) -> tuple[Segment, ...]:
    """Return what has to be written into the board's memory, in order of the addresses."""
    data, header = _read(elf)
    place, size, count = header[5], header[9], header[10]
    found = []
    for number in range(count):
        kind, offset, _, physical, in_file, *_ = _PROGRAM.unpack_from(data, place + number * size)
        if kind == _LOAD and in_file:
            found.append(Segment(physical, data[offset : offset + in_file]))
    return tuple(sorted(found, key=lambda segment: segment.address))


def entry_of(elf: Path) -> int:
    """Return the address of the image's first instruction."""
    _, header = _read(elf)
    return int(header[4])


def _read(elf: Path) -> tuple[bytes, tuple[int, ...]]:
    data = elf.read_bytes()
    if len(data) < _HEADER.size or data[:6] != _IDENTITY:
        raise ToolError(f"{elf.name} is no image for a 32-bit processor: build it again")
    return data, _HEADER.unpack_from(data)


def flat(parts: Sequence[Segment]) -> Segment:
    """Return one stretch that holds all segments; what lies between them reads as erased flash."""
    first = parts[0].address
    last = max(part.address + len(part.data) for part in parts)
    memory = bytearray(b"\xff" * (last - first))
    for part in parts:
        memory[part.address - first : part.address - first + len(part.data)] = part.data
    return Segment(first, bytes(memory))
