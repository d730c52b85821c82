"""An image in QEMU over two pipes, which it opens through semihosting: the fastest line there is.

The image opens two names in the folder that QEMU runs in. They lead to pipes that QEMU inherits, for a pipe without a
name of its own keeps no times of last use, which cost a named one a tenth of an exchange.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import ExitStack
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.identify.simulation.scratch import make_scratch
from firmloop.verify.link import LinkError
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.opener import Opener
from firmloop.verify.links.qemu import QemuProcess, qemu_of
from firmloop.verify.links.stream import PipeStream
from firmloop.verify.links.turns import PipeTurns, Processors

DESCRIPTORS = Path("/proc/self/fd")  # where an image that inherits a pipe finds it by name
OPENING = 60.0  # s until the image must have answered first; it takes some 0.1 s
TIMEOUT = 30.0  # s for the reply to one attempt, on a busy machine; a dead QEMU is noticed at once
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
    if not DESCRIPTORS.is_dir():
        raise LinkError(
            f"not supported here: semihosting takes {DESCRIPTORS}, which only Linux has; take another link: --port pty"
        )
    where = f"semihosting in QEMU {qemu.machine}"
    with ExitStack() as undo:
        scratch = make_scratch(Path(tempfile.gettempdir()), "firmloop", 0o700)
        undo.callback(scratch.remove)
        asked, writer = _pipe(undo)
        reader, answered = _pipe(undo)
        for name, end in (("to_target", asked), ("to_host", answered)):
            (scratch.path / name).symlink_to(DESCRIPTORS / str(end))
        os.set_blocking(writer, False)
        processors = Processors()
        undo.callback(processors.undo)
        arguments = ("-serial", "none", "-semihosting-config", "enable=on,target=native")
        process = QemuProcess(qemu, elf, arguments, (asked, answered), scratch)
        undo.pop_all()
    os.close(asked)
    os.close(answered)

    def fate() -> str:
        return f"{where}: {process.fate()}"

    def close() -> None:
        processors.undo()
        os.close(writer)  # the image finds that nobody is there and ends QEMU
        os.close(reader)
        process.finish()

    way = PipeTurns(processors, process.number, reader, writer)
    stream = PipeStream(reader, writer, TIMEOUT, OPENING, fate, close, way)
    return FramedLink(stream, where, program_id, TIMEOUT, ATTEMPTS)


def _pipe(undo: ExitStack) -> tuple[int, int]:
    reader, writer = os.pipe()
    undo.callback(os.close, reader)
    undo.callback(os.close, writer)
    return reader, writer


LINK = Opener("semihosting", "semihosting", open_semihosting)
