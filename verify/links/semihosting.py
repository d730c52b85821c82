"""An image in QEMU over two named pipes, which it opens through semihosting: the fastest line there is."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from codegen.target import Target
from verify.links import LinkError
from verify.links.affinity import share_one_processor
from verify.links.framed import FramedLink
from verify.links.opener import Opener
from verify.links.qemu import QemuProcess, qemu_of
from verify.links.stream import PipeStream

OPENING = 60.0  # s until the image must have opened its pipe; it takes some 0.1 s
TIMEOUT = 5.0  # s for the reply to one attempt; a dead QEMU is noticed at once
ATTEMPTS = 2


def open_semihosting(target: Target, elf: Path, program_id: str) -> FramedLink:
    """Run the image `elf` in QEMU and greet it.

    Raises
    ------
    LinkError
        when QEMU or the image dies, does not answer, or runs another program.
    ToolError
        when QEMU is not installed.
    """
    qemu = qemu_of(target)
    where = f"semihosting in QEMU {qemu.machine}"
    with ExitStack() as undo:
        folder = Path(tempfile.mkdtemp(prefix="firmloop."))
        undo.callback(shutil.rmtree, folder, ignore_errors=True)
        os.mkfifo(folder / "to_target", 0o600)
        os.mkfifo(folder / "to_host", 0o600)
        # Opened before QEMU starts: the image then finds a reader and does not wait for one.
        reader = os.open(folder / "to_host", os.O_RDONLY | os.O_NONBLOCK)
        undo.callback(os.close, reader)
        spread = share_one_processor()
        undo.callback(spread)
        arguments = ("-serial", "none", "-semihosting-config", "enable=on,target=native")
        process = QemuProcess(qemu, elf, arguments, (), folder)
        undo.callback(process.stop)
        writer = _open_writer(folder / "to_target", process, where)
        undo.pop_all()

    def fate() -> str:
        return f"{where}: {process.fate()}"

    def close() -> None:
        spread()
        os.close(writer)  # the image reads the end of its input and ends QEMU
        process.finish()
        os.close(reader)

    stream = PipeStream(reader, writer, TIMEOUT, fate, close, folder / "to_host")
    return FramedLink(stream, where, program_id, TIMEOUT, ATTEMPTS)


def _open_writer(pipe: Path, process: QemuProcess, where: str) -> int:
    deadline = time.monotonic() + OPENING
    while True:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as error:
            if error.errno != errno.ENXIO:  # ENXIO: nobody reads it yet
                raise
        if not process.running():
            raise LinkError(f"{where}: {process.fate()}")
        if time.monotonic() > deadline:
            raise LinkError(f"{where}: the image did not open its pipe within {OPENING:g} s: rebuild the image")
        time.sleep(0.002)


LINK = Opener("semihosting", "semihosting", open_semihosting)
