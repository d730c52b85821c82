"""Check that the processor of a target can start from an image, as far as the image tells."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.identify.simulation.compiler import ToolError
from firmloop.verify.build.elf import Segment, entry_of, flat, segments

BOOT_BYTES = 256  # of a second stage, in front of everything
CRC_POLYNOMIAL = 0x04C11DB7


def check_start(elf: Path, target: Target) -> None:
    """Check where the image lies and is entered, and what its start-up needs: starts/<startup>.py says what.

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
    check: Callable[[Segment, int, Target], None] = import_module(f"{__package__}.starts.{target.startup}").check
    check(Segment(image.address + skipped, image.data[skipped:]), entry_of(elf), target)


def boot_crc(data: bytes) -> int:
    """Return the CRC-32 that the boot ROM of an RP2040 computes (its datasheet, section 2.8.1.3.1)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = ((crc << 1) ^ (CRC_POLYNOMIAL if crc >> 31 else 0)) & 0xFFFFFFFF
    return crc
