"""Find a controller's step in a linked image, and the bytes around it."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from firmloop.verify.proofs.machine.vex import UndecidedError

# System V ABI, "Object Files", 32 bits, little-endian; the machine's number is Arm's.
_HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
_PROGRAM = struct.Struct("<8I")
_SECTION = struct.Struct("<10I")
_SYMBOL = struct.Struct("<IIIBBH")
_IDENTITY, _ARM, _LOAD, _SYMBOLS = b"\x7fELF\x01\x01", 40, 1, 2


@dataclass(frozen=True, slots=True)
class MachineCode:
    """The first segment of an image, which is its flash, and where functions begin in it."""

    base: int
    flash: bytes
    functions: dict[str, tuple[int, int]]  # address without the bit of Thumb, bytes


def read_code(path: Path) -> MachineCode:
    """Read an image for a Cortex-M.

    Raises
    ------
    UndecidedError
        when it is none.
    """
    data = path.read_bytes()
    if len(data) < _HEADER.size or data[:6] != _IDENTITY:
        raise UndecidedError("it is no image for a 32-bit processor")
    header = _HEADER.unpack_from(data)
    if header[2] != _ARM:
        raise UndecidedError("it is an image for another processor than a Cortex-M")
    try:
        parts = [_PROGRAM.unpack_from(data, header[5] + k * header[9]) for k in range(header[10])]
        offset, base, size = next((p[1], p[3], p[4]) for p in parts if p[0] == _LOAD and p[4])
        sections = [_SECTION.unpack_from(data, header[6] + k * header[11]) for k in range(header[12])]
        functions = {}
        for section in (one for one in sections if one[1] == _SYMBOLS):
            names = sections[section[6]]
            for at in range(section[4], section[4] + section[5], _SYMBOL.size):
                name, value, length, *_ = _SYMBOL.unpack_from(data, at)
                start = names[4] + name
                functions[data[start : data.index(b"\0", start)].decode()] = value & ~1, length
    except (struct.error, StopIteration, IndexError, ValueError):
        raise UndecidedError("it is damaged: build it again") from None
    return MachineCode(base, data[offset : offset + size], functions)
