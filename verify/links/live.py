"""Watch a controller that runs by itself: take samples as they come, count what was lost, set what can be tuned.

request            payload                     reply type = request type | 0x80, same sequence
HELLO 0x41         ticket u32                  ticket u32, protocol u32, steps u32, late steps u32, lost samples u32,
                                               members u32, program id (16 characters)
WATCH 0x42         ticket u32, mask u32,       the same; from now on, every so many steps, the members of the mask
                   every u32
SET   0x43         ticket u32, which u32,      ticket u32, step u32 it acts from, 1 if it was set or 0 u32
                   value
DATA  0x40         (comes unasked)             lost samples u32 since WATCH, steps u32, then per sample:
                                               step u32 and the members, packed, in order

SET takes the number of the parameter and its value as the C holds it; the image sets it between two steps.
Framing is that of verify/links/frame.py; the image's half is templates_c/live.c.j2. Requests may be repeated without
harm. The host draws a ticket for every request. What is late is not mistaken: a reply repeats its request's ticket, and
the CRC of DATA goes on from that of exchange 0 in a session that has the ticket of the WATCH in force as its number.
"""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from firmloop.codegen.target import Target
from firmloop.quantize.program import Program, Value
from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import REPLY, FrameError, binding, seal, unseal
from firmloop.verify.links.pty import start_on_terminal
from firmloop.verify.links.stream import Stream, open_serial
from firmloop.verify.links.uart import (
    DEFAULT_BAUD,
    PORT_ATTEMPTS,
    PORT_TIMEOUT,
    QEMU_ATTEMPTS,
    QEMU_TIMEOUT,
    port_stream,
)
from firmloop.verify.reference import Raw, element_type

DATA, HELLO, WATCH, SET = 0x40, 0x41, 0x42, 0x43
PROTOCOL_VERSION = 2
STATUS = "status"
_HELLO = struct.Struct("<5I16s")
_WATCH = struct.Struct("<2I")
_WHICH = struct.Struct("<I")
_SET = struct.Struct("<2I")
_HEAD = struct.Struct("<2I")
_TICKET = 4  # bytes


@dataclass(frozen=True, slots=True)
class State:
    """What the image says of its run so far; `late` steps began a whole period or more after they were due."""

    steps: int
    late: int
    lost: int


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of one message: `rows` has the field `step` and one a member, raw; `lost` is the count since WATCH."""

    rows: Raw
    lost: int


class LiveLink:
    """A controller that runs at its period behind a byte stream."""

    def __init__(self, stream: Stream, where: str, program: Program, timeout: float, attempts: int) -> None:
        """Greet the image and check that it runs `program`; close the stream if that fails."""
        self._stream, self._where, self._program = stream, where, program
        self._timeout, self._attempts = timeout, attempts
        self.period = program.period  # s
        self._sequence = 0
        self._ticket = bytes(_TICKET)  # of the last request
        self._bound = 0  # CRC that DATA of the watch in force goes on from
        self._pending = b""
        self._data: list[bytes] = []
        self._kind: np.dtype[np.void] | None = None
        try:
            self.state()
        except BaseException:
            stream.close()
            raise

    def state(self) -> State:
        """Ask how its run goes."""
        payload = self._ask(HELLO, b"", _HELLO.size)
        protocol, steps, late, lost, members, found = _HELLO.unpack(payload)
        if protocol != PROTOCOL_VERSION or members != len(watchable(self._program)):
            raise LinkError(
                f"{self._where}: the image speaks another version of the line's protocol: rebuild the image"
            )
        found_id = found.decode("ascii", "replace")
        if found_id != self._program.id:
            raise LinkError(
                f"{self._where}: the image runs program {found_id}, this project's is {self._program.id}: "
                "flash it again, with: firmloop flash ... --live FILE.c"
            )
        return State(steps, late, lost)

    def watch(self, names: tuple[str, ...], every: int) -> None:
        """Ask for these members of every `every`-th step; what came of an earlier watch is forgotten."""
        members = watchable(self._program)
        mask = sum(1 << number for number, name in enumerate(members) if name in names)
        self._ask(WATCH, _WATCH.pack(mask, every), _WATCH.size)
        self._bound = binding(int.from_bytes(self._ticket, "little"), 0)
        self._data.clear()
        fields = [(name, kind) for name, kind in members.items() if name in names]
        self._kind = np.dtype([("step", "<u4"), *fields])

    def set(self, name: str, value: Raw) -> int:
        """Set a parameter to the raw `value` (1,); return the number of the first step that it acts on."""
        names = [parameter.name for parameter in self._program.parameters]
        reply = self._ask(SET, _WHICH.pack(names.index(name)) + value.tobytes(), _SET.size)
        step, done = _SET.unpack(reply)
        if not done:
            raise LinkError(f"{self._where}: the image refused {name} = {value[0]}: it is out of its proven range")
        return int(step)

    def samples(self, timeout: float) -> Iterator[Samples]:
        """Yield what is there or comes within `timeout` seconds; a damaged message is missing, as its steps tell."""
        assert self._kind is not None, "watch() comes first"
        if not self._data:
            self._take(self._stream.read(timeout))
        waiting, self._data = self._data, []
        for payload in waiting:
            rest = len(payload) - _HEAD.size
            if rest < 0 or rest % self._kind.itemsize:
                continue  # of an earlier watch, still on its way
            yield Samples(np.frombuffer(payload, self._kind, offset=_HEAD.size), _HEAD.unpack_from(payload)[0])

    def close(self) -> None:
        """Ask for silence, if the line still carries it, and let go; the controller runs on."""
        try:
            self._stream.write(b"\0" + seal(WATCH, self._sequence, self._ticket + _WATCH.pack(0, 1)))
        except LinkError:
            pass  # the line has gone, and with it those who could hear
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, kind: int, payload: bytes, size: int) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        self._ticket = os.urandom(_TICKET)
        request = b"\0" + seal(kind, self._sequence, self._ticket + payload)
        for _ in range(self._attempts):
            self._stream.write(request)
            deadline = time.monotonic() + self._timeout
            while (left := deadline - time.monotonic()) > 0:
                for found, number, reply in self._take(self._stream.read(left)):
                    if (found, number, reply[:_TICKET]) == (kind | REPLY, self._sequence, self._ticket):
                        if len(reply) == _TICKET + size:
                            return reply[_TICKET:]
        raise LinkError(
            f"{self._where}: no reply within {self._attempts} attempts of {self._timeout:g} s: check that a live image "
            "runs (firmloop flash ... --live FILE.c), the baud rate and the wiring"
        )

    def _take(self, data: bytes) -> list[tuple[int, int, bytes]]:
        """Sort what came: samples are kept, replies returned, damage passed over."""
        blocks = (self._pending + data).split(b"\0")
        self._pending = blocks.pop()[-4096:]
        replies = []
        for block in blocks:
            for bound in (self._bound, 0) if block else ():
                with suppress(FrameError):
                    message = unseal(block, bound)
                    if message[0] != DATA:
                        replies.append(message)
                    elif bound:
                        self._data.append(message[2])
                    break
        return replies


def watchable(program: Program) -> dict[str, np.dtype[np.generic]]:
    """Return the members of a step by name, in the order of the image's bits."""
    values: tuple[Value, ...] = (*program.inputs, *program.outputs, *program.parameters)
    return {**{value.name: element_type(value.number) for value in values}, STATUS: np.dtype("<u4")}


def open_live_port(target: Target, url: str, program: Program) -> LiveLink:
    """Greet a live image on a device, a pseudo-terminal's path or any URL of pyserial.

    Raises
    ------
    LinkError
        when the port is not there, goes away, does not answer, or its image runs another program.
    """
    stream, where = port_stream(target, url)
    return LiveLink(stream, where, program, PORT_TIMEOUT, PORT_ATTEMPTS)


def start_live(target: Target, elf: Path, program: Program) -> LiveLink:
    """Run the live image `elf` on the emulated core of the target and greet it; it ends when the link is closed.

    Raises
    ------
    LinkError
        when QEMU or the image dies or does not answer.
    ToolError
        when QEMU is not installed.
    """
    with ExitStack() as undo:
        process, path = start_on_terminal(target, elf)
        undo.callback(process.stop)

        def fate() -> str:
            return f"the emulated core {target.name}: {process.fate()}"

        stream = open_serial(path, DEFAULT_BAUD, QEMU_TIMEOUT, fate, undo.pop_all().close)
    return LiveLink(stream, f"the emulated core {target.name}", program, QEMU_TIMEOUT, QEMU_ATTEMPTS)
