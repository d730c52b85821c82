"""An image in QEMU behind a pseudo-terminal, which looks to a program as a board's serial port does."""

from __future__ import annotations

import re
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.identify.simulation.scratch import make_scratch
from firmloop.verify.link import LinkError
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.opener import Opener
from firmloop.verify.links.qemu import QemuProcess, qemu_of
from firmloop.verify.links.turns import share_processor
from firmloop.verify.links.uart import greet

OPENING = 60.0  # s until QEMU must have said which terminal it took; it takes some 0.1 s


def open_qemu_pty(target: Target, elf: Path, program_id: str) -> FramedLink:
    """Run the image `elf` in QEMU and greet it over a pseudo-terminal.

    Raises
    ------
    LinkError
        when QEMU or the image dies, does not answer, or runs another program.
    ToolError
        when QEMU is not installed.
    """
    with ExitStack() as undo:
        undo.callback(share_processor(target))
        process, path = start_on_terminal(target, elf)
        undo.callback(process.stop)
        return greet(undo, process, path, f"pseudo-terminal {path} of QEMU {process.machine}", program_id)


def start_on_terminal(target: Target, elf: Path) -> tuple[QemuProcess, str]:
    """Run the image `elf` and return the emulator, to be stopped by the caller, with the path of its terminal."""
    with ExitStack() as undo:
        scratch = make_scratch(Path(tempfile.gettempdir()), "firmloop", 0o700)
        undo.callback(scratch.remove)
        process = QemuProcess(qemu_of(target), elf, ("-serial", "pty"), (), scratch)
        undo.callback(process.stop)
        path = _terminal(process, process.machine)
        undo.pop_all()
    return process, path


def _terminal(process: QemuProcess, machine: str) -> str:
    """Wait until QEMU says which pseudo-terminal it took."""
    deadline = time.monotonic() + OPENING
    while time.monotonic() < deadline:
        found = re.search(r"redirected to (/\S+) ", process.words())
        if found:
            return found.group(1)
        if not process.running():
            break
        time.sleep(0.005)
    raise LinkError(f"pseudo-terminal of QEMU {machine}: {process.fate()}")


LINK = Opener("pty", "uart", open_qemu_pty)
