"""Put an image onto a board: through pyOCD or OpenOCD where one is installed, else as a file to drag onto its drive."""

from __future__ import annotations

import os
import shutil
import struct
import tempfile
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.identify.simulation.compiler import ToolError, run_compiler
from firmloop.identify.simulation.scratch import scratch_folder
from firmloop.verify.build.elf import Segment, flat, segments

UF2_MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)  # USB Flashing Format, its specification's first table
UF2_FAMILY_PRESENT = 0x2000
UF2_RP2040 = 0xE48BFF56
UF2_PAYLOAD = 256
HEX_ROW = 16


def flash_command(target: Target, elf: Path) -> tuple[str, ...] | None:
    """Return the command that flashes `elf`, None where neither tool is installed or knows the board.

    Raises
    ------
    ToolError
        when OpenOCD would take the path of `elf` for a part of its script.
    """
    if target.flash is None:
        return None
    elf = elf.resolve()
    if target.flash.pyocd and shutil.which("pyocd"):
        return ("pyocd", "flash", "--target", target.flash.pyocd, str(elf))
    if target.flash.openocd and shutil.which("openocd"):
        if set(str(elf)) & set("{}\\\n"):
            raise ToolError(f"openocd cannot take the path {str(elf)!r}: choose an --out without braces or backslashes")
        files = [part for name in target.flash.openocd for part in ("-f", name)]
        return ("openocd", *files, "-c", f"program {{{elf}}} verify reset exit")
    return None


def flash(command: tuple[str, ...]) -> str:
    """Run it; return what the tool said, or raise ToolError with its first lines.

    Both tools run scripts that lie where they are started (pyocd_user.py, board/*.cfg): that is an empty folder.
    """
    with scratch_folder(Path(tempfile.gettempdir()), "firmloop") as folder:
        return run_compiler(command, folder)


def drag_file(target: Target, elf: Path) -> Path | None:
    """Write the file that the board's drive takes beside `elf`; None for a board without a drive."""
    if target.flash is None or target.flash.drag is None:
        return None
    path = elf.with_suffix(f".{target.flash.drag}")
    image = flat(segments(elf))
    data = {"bin": image.data, "hex": intel_hex(image), "uf2": uf2(image)}[target.flash.drag]
    partial = path.with_suffix(".part")
    partial.write_bytes(data)
    os.replace(partial, path)
    return path


def intel_hex(image: Segment) -> bytes:
    """Return the image as Intel HEX (Hexadecimal Object File Format Specification, revision A), 32-bit addresses."""
    rows, upper = [], -1
    for at in range(0, len(image.data), HEX_ROW):
        address = image.address + at
        if address >> 16 != upper:
            upper = address >> 16
            rows.append(_hex_row(0, 4, struct.pack(">H", upper)))
        rows.append(_hex_row(address & 0xFFFF, 0, image.data[at : at + HEX_ROW]))
    return "".join([*rows, _hex_row(0, 1, b"")]).encode()


def _hex_row(address: int, kind: int, data: bytes) -> str:
    row = struct.pack(">BHB", len(data), address, kind) + data
    return f":{row.hex().upper()}{-sum(row) & 0xFF:02X}\n"


def uf2(image: Segment) -> bytes:
    """Return the image in blocks of 512 bytes as the boot ROM of an RP2040 takes them (datasheet, 2.8.4)."""
    count = -(-len(image.data) // UF2_PAYLOAD)
    blocks = []
    for number in range(count):
        at = number * UF2_PAYLOAD
        payload = image.data[at : at + UF2_PAYLOAD].ljust(476, b"\0")
        place = (image.address + at, UF2_PAYLOAD, number, count)
        head = (*UF2_MAGIC[:2], UF2_FAMILY_PRESENT, *place, UF2_RP2040)
        blocks.append(struct.pack("<8I", *head) + payload + struct.pack("<I", UF2_MAGIC[2]))
    return b"".join(blocks)
