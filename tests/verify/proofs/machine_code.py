"""Linked images for tests of their judge, and images whose constants are wrong by one unit."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.law import Law
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.build.elf import segments
from firmloop.verify.build.image import build_image
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.reading import read_claims

_LITERAL = re.compile(r"ldr(?:\.w)?\s+\w+, \[pc, .*@ \(([0-9a-f]+) ")


def linked(law: Law, number: str, target: str, folder: Path) -> tuple[Claims, Path]:
    """Link the image of a law for a target; return what its proof claims, and the image."""
    program = lower(law, number)
    board = load_target(target)
    image = build_image(firmware(program, emit(program, "test"), board, board.links[0]), board, folder)
    return read_claims(json.loads(json.dumps(proof(program, law.reasons)))), image.elf


def off_by_one(claims: Claims, elf: Path) -> Iterator[bytes]:
    """Every image with one constant, which the step loads from the code, one unit larger or smaller."""
    command = ["arm-none-eabi-objdump", "-d", f"--disassemble={claims.name}_step", str(elf)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    data = elf.read_bytes()
    code = segments(elf)[0]
    begin = data.index(code.data)
    for place in sorted({int(found, 16) for found in _LITERAL.findall(said)}):
        at = begin + place - code.address
        constant = int.from_bytes(data[at : at + 4], "little")
        for changed in (constant + 1, constant - 1):
            yield data[:at] + (changed % 2**32).to_bytes(4, "little") + data[at + 4 :]
