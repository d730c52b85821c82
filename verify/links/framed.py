"""The host's half of the line: one request, one reply, repeated in bounded time until both are whole."""

from __future__ import annotations

import math
import os
import struct
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from firmloop.verify.link import Hello, LinkError, fault_says
from firmloop.verify.links.frame import (
    HELLO,
    NAK,
    NAK_DAMAGED,
    NAK_SESSION,
    PROTOCOL_VERSION,
    REASONS,
    REFUSAL,
    REPLY,
    RESET,
    STACK,
    STEP,
    FrameError,
    binding,
    checksum,
    seal,
    unseal,
)
from firmloop.verify.links.stream import PipeStream, Stream

_HELLO = struct.Struct("<IHHHHI16s")
_FIRST_GREETING = 1.0  # s for a reply to the first greeting; each further one doubles it, up to the line's own timeout
_DEPTH = struct.Struct("<I")
COST_BYTES = 8  # status and ticks of one step
NOISE_MOST = 1 << 18  # bytes without a zero byte that are kept; longer than any frame


class FramedLink:
    """A controller behind a byte stream that may lose, damage or repeat bytes."""

    def __init__(
        self,
        stream: Stream,
        where: str,
        program_id: str,
        timeout: float,
        attempts: int,
        clock: Callable[[], float] = time.monotonic,
        draw: Callable[[int], bytes] = os.urandom,
    ) -> None:
        """Greet the far end and check that it runs the program `program_id`; close the stream if that fails.

        Parameters
        ----------
        where
            names the link in messages, such as "UART socket://127.0.0.1:4000"
        timeout
            s, for the reply to one attempt
        attempts
            how often a request without a reply is sent
        clock
            tells the time in s by which replies are late
        draw
            returns so many random bytes, for the number of the session
        """
        self._stream = stream
        self._where = where
        self._timeout = timeout
        self._attempts = attempts
        self._early = max(0, math.ceil(math.log2(timeout / _FIRST_GREETING))) if timeout > 0.0 else 0
        self._clock = clock
        self._pending = b""  # what came after the last zero byte
        self._blocks: list[bytes] = []  # complete blocks nobody looked at yet
        self._session = draw(4)
        self._number = -1  # of the last exchange
        self._bound = 0
        self._pipe = stream if isinstance(stream, PipeStream) else None
        try:
            self._hello = self._greet(program_id)
        except BaseException:
            stream.close()
            raise

    def hello(self) -> Hello:
        """Return what the far end said of itself when the link was opened."""
        return self._hello

    def reset(self) -> None:
        """Put the controller into its first state."""
        self._exchange(RESET, b"")

    def step(self, inputs: bytes, count: int) -> bytes:
        """Run `count` steps over packed input structs; return (output struct, status u32, ticks u32) of each."""
        hello = self._hello
        if len(inputs) != count * hello.in_bytes:
            raise LinkError(
                f"{self._where}: {count} steps take {count * hello.in_bytes} bytes of inputs there, not {len(inputs)}: "
                "rebuild the image"
            )
        if 0 < count <= hello.steps_max:
            results = self._exchange(STEP, inputs)
            if len(results) != count * (hello.out_bytes + COST_BYTES):
                raise LinkError(
                    f"{self._where}: the reply to {count} steps has {len(results)} bytes: rebuild the image"
                )
            return results
        frame = hello.steps_max * hello.in_bytes
        return b"".join(
            self.step(inputs[at : at + frame], len(inputs[at : at + frame]) // hello.in_bytes)
            for at in range(0, len(inputs), frame)
        )

    def lanes(self, inputs: bytes, lanes: int, steps: int) -> bytes:
        """Run lanes of `steps` steps behind one another, each from the first state; return what `step` does of each."""
        size = len(inputs) // lanes
        answers = []
        for at in range(0, len(inputs), size):
            self.reset()
            answers.append(self.step(inputs[at : at + size], steps))
        return b"".join(answers)

    def stack(self, inputs: bytes) -> int:
        """Return the deepest stack in bytes of one step, over packed input structs from a fresh start.

        The controller is in its first state afterwards. The depth begins at the call of step() and is what the step
        really wrote, so a path that these inputs do not take is not in it.
        """
        frame = self._hello.steps_max * self._hello.in_bytes
        replies = [self._exchange(STACK, inputs[at : at + frame]) for at in range(0, len(inputs), frame)]
        for reply in replies:
            if len(reply) != _DEPTH.size:
                raise LinkError(f"{self._where}: the depth of the stack came in {len(reply)} bytes: rebuild the image")
        return max(int(_DEPTH.unpack(reply)[0]) for reply in replies)

    def close(self) -> None:
        """Let go of the line and of what was started for it; a second call does nothing."""
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _greet(self, program_id: str) -> Hello:
        payload = self._exchange(HELLO, self._session)
        if len(payload) < 6 or payload[4:6] != PROTOCOL_VERSION.to_bytes(2, "little") or len(payload) != _HELLO.size:
            raise LinkError(
                f"{self._where}: the image speaks another version of the line's protocol: rebuild the image"
            )
        _, _, in_bytes, out_bytes, steps_max, overhead, found = _HELLO.unpack(payload)
        found_id = found.decode("ascii", "replace")
        if found_id != program_id:
            raise LinkError(
                f"{self._where}: the image runs program {found_id}, this project's is {program_id}: "
                "rebuild the image, and flash it if it is on a board"
            )
        frame = steps_max * max(in_bytes, out_bytes + COST_BYTES)
        if not (in_bytes and out_bytes and 0 < frame <= NOISE_MOST):
            raise LinkError(
                f"{self._where}: the image says {steps_max} steps a frame, of {in_bytes} bytes in and {out_bytes} out, "
                f"where a frame has 1 to {NOISE_MOST} bytes: rebuild the image"
            )
        return Hello(found_id, in_bytes, out_bytes, steps_max, overhead)

    def _exchange(self, kind: int, payload: bytes) -> bytes:
        self._number = number = (self._number + 1) & 0xFFFFFFFF
        sequence = number & 0xFF
        if not sequence:
            self._bound = binding(int.from_bytes(self._session, "little"), number)
        begin = self._clock()
        data = None
        if self._pipe is not None and kind != HELLO and not self._blocks and not self._pending:
            whole, data = self._pipe.exchange(kind, sequence, self._bound, payload, self._timeout)
            if whole is not None:
                return whole
        if data is None:
            frame = seal(kind, sequence, payload, self._bound)
            self._stream.write(b"\0" + frame if kind == HELLO else frame)
            data = self._stream.read(self._patience(kind, 0))
        # Nearly always one whole frame comes at once: spare it the general way, which costs as much as all the rest.
        if data.find(0) == len(data) - 1 and data and not self._blocks and not self._pending:
            try:
                found, answered, reply = unseal(data[:-1], self._bound)
            except FrameError:
                found = NAK
            if found == kind | REPLY and answered == sequence and kind != HELLO:
                return reply
        self._take(data)
        return self._converse(kind, sequence, payload, begin)

    def _converse(self, kind: int, sequence: int, payload: bytes, begin: float) -> bytes:
        """Wait for the reply to a request first sent at `begin`, sending it again as often as allowed."""
        again = b"\0" + seal(kind, sequence, payload, self._bound)
        crc = checksum(kind, sequence, payload, self._bound)
        for attempt in range(self._attempts + (self._early if kind == HELLO else 0)):
            if attempt:
                self._stream.write(again)
                begin = self._clock()
            deadline = begin + self._patience(kind, attempt)
            damaged = disowned = False
            while (message := self._receive(deadline)) is not None:
                found, answered, reply = message
                if found == kind | REPLY and answered == sequence and self._is_ours(kind, reply):
                    return reply
                if found != NAK:
                    continue  # a late reply to an earlier request
                reason, refused = REFUSAL.unpack(reply) if len(reply) == REFUSAL.size else (NAK_DAMAGED, 0)
                if refused == crc and reason != NAK_DAMAGED:
                    raise LinkError(self._refusal(reason))
                disowned |= refused == crc
                # It may speak of noise before our request, whose reply then comes behind it; and one such noise may
                # be many blocks. So the request is sent again once, and when nothing else is at hand.
                if not damaged and not self._blocks:
                    damaged = True
                    self._stream.write(again)
        if disowned:
            raise LinkError(self._refusal(NAK_SESSION))
        raise LinkError(
            f"{self._where}: no reply within {self._attempts} attempts of {self._timeout:g} s: check that the image "
            "runs, the baud rate, the wiring, and that this version of firmloop built the image"
        )

    def _patience(self, kind: int, attempt: int) -> float:
        """Return how long a reply may take, s: little at first for a greeting, which the far end may not be up for."""
        return min(self._timeout, _FIRST_GREETING * 2.0**attempt) if kind == HELLO else self._timeout

    def _is_ours(self, kind: int, reply: bytes) -> bool:
        """Tell the reply to our HELLO from one to a host before us."""
        return kind != HELLO or reply[:4] == self._session

    def _refusal(self, reason: int) -> str:
        if reason == NAK_SESSION:
            return f"{self._where}: the image knows nothing of this session: it was reset on the way; run again"
        return f"{self._where}: the image refused a request ({REASONS.get(reason, reason)}): rebuild the image"

    def _receive(self, deadline: float) -> tuple[int, int, bytes] | None:
        """Return the next whole message, or None at the deadline; what is damaged stands for a NAK."""
        while True:
            while self._blocks:
                block = self._blocks.pop(0)
                try:
                    return unseal(block, self._bound)
                except FrameError:
                    if block.startswith(b"FAULT "):
                        raise LinkError(f"{self._where}: {fault_says(_printable(block))}") from None
                    return NAK, 0, b""
            left = deadline - self._clock()
            if left <= 0:
                return None
            self._take(self._stream.read(left))

    def _take(self, data: bytes) -> None:
        if data:
            blocks = (self._pending + data).split(b"\0")
            self._pending = blocks.pop()[-NOISE_MOST:]
            self._blocks += [block for block in blocks if block]


def _printable(block: bytes) -> str:
    return "".join(chr(byte) if 32 <= byte < 127 else "?" for byte in block[:400]).strip("? ")
