"""Images of the tiny controller for tests: one that runs as a process of this machine, others for QEMU."""

from __future__ import annotations

import os
import random
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from firmloop.codegen.bundle import write_files
from firmloop.codegen.firmware import WARNINGS, firmware
from firmloop.codegen.target import load_target
from firmloop.identify.simulation.compiler import run_compiler
from firmloop.verify.build.image import Image, build_image
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.stream import DescriptorStream, Stream
from tests.verify.tiny import tiny

C_TESTS = Path(__file__).parents[1] / "c"
GAIN = 2.0
DICE = random.Random(0)
PROGRAM, BUNDLE = tiny(GAIN)
TARGET = load_target("qemu_mps2_an386")


def build_host_image(folder: Path) -> Path:
    """Compile the image's main.c and frame.c for this machine, over standard input and output."""
    files = {name: text for name, text in firmware(PROGRAM, BUNDLE, TARGET, "uart").items()}
    board = [name for name in files if name.startswith("board/") and name.endswith(".c")]
    for name in board:
        del files[name]
    files["board_host.c"] = (C_TESTS / "board_host.c").read_text()
    write_files(files, folder)
    sources = [name for name in files if name.endswith(".c")]
    run_compiler(["gcc", "-std=gnu99", "-O1", "-fsanitize=undefined", *WARNINGS, *sources, "-o", "image"], folder)
    return folder / "image"


def start_host_image(image: Path) -> tuple[DescriptorStream, subprocess.Popen[bytes]]:
    """Run it behind two pipes."""
    process = subprocess.Popen([image], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None and process.stdout is not None
    reader, writer = process.stdout.fileno(), process.stdin.fileno()
    os.set_blocking(reader, False)
    os.set_blocking(writer, False)

    def release() -> None:
        process.stdin.close()
        process.stdout.close()
        process.kill()
        process.wait()

    return DescriptorStream(reader, writer, 1.0, lambda: "host image: it is gone", release), process


def link_to(stream: Stream) -> FramedLink:
    return FramedLink(stream, "test line", PROGRAM.id, timeout=0.05, attempts=400, draw=DICE.randbytes)


def expected(a: np.ndarray, b: np.ndarray, total: float) -> tuple[np.ndarray, float]:
    """Outputs of the tiny controller in float32, and the sum it then holds."""
    outputs = []
    held = np.float32(total)
    for x, y in zip(a, b, strict=True):
        held = held + x
        outputs.append(held + np.float32(GAIN) * y)
    return np.array(outputs, np.float32), float(held)


def packed(a: np.ndarray, b: np.ndarray) -> bytes:
    return np.column_stack([a, b]).astype("<f4").tobytes()


RESULT = np.dtype([("sum", "<f4"), ("status", "<u4"), ("ticks", "<u4")])
ONE_STEP: Callable[[float, float], bytes] = struct.Struct("<2f").pack


def build_qemu_image(transport: str, folder: Path) -> Image:
    """Cross-compile the tiny controller for the QEMU target."""
    return build_image(firmware(PROGRAM, BUNDLE, TARGET, transport), TARGET, folder)
