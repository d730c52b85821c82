"""An image behind a UART: QEMU's over TCP, or a real one on any port that pyserial opens."""

from __future__ import annotations

import socket
import tempfile
from contextlib import ExitStack
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.identify.simulation.scratch import make_scratch
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.opener import Opener
from firmloop.verify.links.qemu import QemuProcess, qemu_of
from firmloop.verify.links.stream import Stream, open_serial
from firmloop.verify.links.turns import share_processor

QEMU_TIMEOUT = 30.0  # s for the reply to one attempt, on a busy machine; a dead QEMU is noticed at once
QEMU_ATTEMPTS = 2
PORT_TIMEOUT = 2.0  # s; a full frame at 115200 bit/s takes 0.3 s there and back
PORT_ATTEMPTS = 4
DEFAULT_BAUD = 115_200  # bit/s, for a target whose file names none


def open_qemu_uart(target: Target, elf: Path, program_id: str) -> FramedLink:
    """Run the image `elf` in QEMU and greet it over its first UART.

    QEMU inherits a socket that already listens, so that no other program can take the port in between.

    Raises
    ------
    LinkError
        when QEMU or the image dies, does not answer, or runs another program.
    ToolError
        when QEMU is not installed.
    """
    qemu = qemu_of(target)
    with ExitStack() as undo:
        scratch = make_scratch(Path(tempfile.gettempdir()), "firmloop", 0o700)
        undo.callback(scratch.remove)
        undo.callback(share_processor(target))
        with socket.create_server(("127.0.0.1", 0), backlog=1) as listener:
            url = f"socket://127.0.0.1:{listener.getsockname()[1]}"
            line = f"socket,id=line,fd={listener.fileno()},server=on,wait=off,nodelay=on"
            process = QemuProcess(
                qemu, elf, ("-chardev", line, "-serial", "chardev:line"), (listener.fileno(),), scratch
            )
        undo.callback(process.stop)
        return greet(undo, process, url, f"UART {url} in QEMU {qemu.machine}", program_id)


def greet(undo: ExitStack, process: QemuProcess, url: str, where: str, program_id: str) -> FramedLink:
    """Greet the image that `process` runs, over `url`; `undo` ends what it stands on, with the link or without one."""

    def fate() -> str:
        return f"{where}: {process.fate()}"

    with undo:
        ends = ExitStack()
        stream = open_serial(url, DEFAULT_BAUD, QEMU_TIMEOUT, fate, ends.close)
        ends.push(undo.pop_all())
    return FramedLink(stream, where, program_id, QEMU_TIMEOUT, QEMU_ATTEMPTS)


def open_port(target: Target, url: str, program_id: str) -> FramedLink:
    """Greet an image that runs already, on a device, a pseudo-terminal's path or any URL of pyserial.

    Raises
    ------
    LinkError
        when the port is not there, goes away, does not answer, or its image runs another program.
    """
    stream, where = port_stream(target, url)
    return FramedLink(stream, where, program_id, PORT_TIMEOUT, PORT_ATTEMPTS)


def port_stream(target: Target, url: str) -> tuple[Stream, str]:
    """Open a port at the target's baud rate; return its bytes and its name in messages."""
    where = f"port {url}"

    def fate() -> str:
        return f"{where}: it is gone or cannot be used: check the cable and the name, then run again"

    def nothing() -> None:
        """End nothing: the board goes on without us."""

    baud = target.uart.baud if target.uart is not None else DEFAULT_BAUD
    return open_serial(url, baud, PORT_TIMEOUT, fate, nothing), where


LINK = Opener("uart", "uart", open_qemu_uart)
