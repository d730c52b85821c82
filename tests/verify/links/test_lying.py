"""Devices that speak the protocol and lie: no figure is taken from them, no watch ends early, and all of it ends."""

from __future__ import annotations

import socket
import struct
import threading
import time

import numpy as np
import pytest

from bench.links.live import stream
from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.quantize.lower.lower import lower
from firmloop.stages.board import watching
from firmloop.stages.board.tape import Seen
from firmloop.stages.board.watching import Watching
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import record_type
from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import HELLO, PROTOCOL_VERSION, STACK, STEP, binding, seal, unseal
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.live import DATA, LiveLink
from firmloop.verify.run import verify
from tests.laws import FULL, pid
from tests.verify.links.test_live import Echo

PROGRAM = lower(pid(FULL), "float32")
IN, OUT = 8, 4


class Liar:
    """A device whose HELLO claims these sizes, and which answers all else with the same bytes."""

    def __init__(self, sizes: tuple[int, int, int], answer: bytes) -> None:
        self._sizes, self._answer = sizes, answer
        self._session, self._waiting = 0, b""

    def write(self, data: bytes) -> None:
        bound = binding(self._session, 0)
        kind, sequence, payload = unseal(data.strip(b"\0"), bound)
        if kind == HELLO:
            self._session = int.from_bytes(payload, "little")
            said = struct.pack("<IHHHHI16s", self._session, PROTOCOL_VERSION, *self._sizes, 0, PROGRAM.id.encode())
        else:
            said = self._answer
        self._waiting += seal(kind | 0x80, sequence, said, bound)

    def read(self, timeout: float) -> bytes:
        waiting, self._waiting = self._waiting, b""
        return waiting

    def close(self) -> None:
        """Have nothing to let go of."""


def greeted(sizes: tuple[int, int, int], answer: bytes = b"") -> FramedLink:
    return FramedLink(Liar(sizes, answer), "test line", PROGRAM.id, 0.2, 1)


@pytest.mark.parametrize("sizes", [(IN, OUT, 0), (0, OUT, 8), (IN, 0, 8), (65535, OUT, 65535), (IN, 65535, 65535)])
def test_sizes_that_no_image_has(sizes: tuple[int, int, int]) -> None:
    with pytest.raises(LinkError, match=r"steps a frame.*rebuild the image"):
        greeted(sizes)


def test_a_size_that_is_not_this_programs() -> None:
    with pytest.raises(LinkError, match="1 steps take 12 bytes of inputs there, not 8"):
        greeted((12, OUT, 8)).step(bytes(8), 1)


@pytest.mark.parametrize("answer", [b"", b"\1", b"\1\2\3", bytes(5)])
def test_a_depth_of_the_stack_that_is_no_number(answer: bytes) -> None:
    with pytest.raises(LinkError, match=rf"came in {len(answer)} bytes"):
        greeted((IN, OUT, 8), answer).stack(bytes(IN))
    assert STACK == 4


class Teller(Echo):
    """A live image that sends one sample after the other, with the steps that it is told to tell."""

    def __init__(self, steps: list[int]) -> None:
        super().__init__(PROGRAM)
        self.link: LiveLink | None = None
        self._steps = steps

    def read(self, timeout: float) -> bytes:
        waiting = super().read(timeout)
        if self.link is not None and self.link._bound and self._steps:
            step = self._steps.pop(0)
            row = struct.pack("<3If", 0, 8, step % 2**32, 1.5)
            waiting += b"\0" + seal(DATA, 0, row, binding(int.from_bytes(self.link._ticket, "little"), 0))
        elif not waiting:
            time.sleep(min(timeout, 0.001))
        return waiting


def watched(steps: list[int], count: int) -> Seen:
    teller = Teller(steps)
    with LiveLink(teller, "test line", PROGRAM, timeout=1.0, attempts=1) as link:
        teller.link = link
        return stream(link, ("output",), 1, count)


@pytest.mark.parametrize(
    "steps",
    [
        [5, 5, 5, 5],  # stands still
        [5, 6, 4, 7],  # goes back
        [5, 6, 6, 7],  # repeats
        [5, 2**32 - 1, 6],  # jumps to the last there is
        [5, 5 + 2**31],
        [900, 0, 1, 2],  # was reset
        [5, 50_000],  # a minute of steps in no time
    ],
)
def test_steps_that_no_run_makes(steps: list[int]) -> None:
    with pytest.raises(LinkError, match=r"step \d+ after step \d+, which no run does"):
        watched(steps, 100)


def test_steps_may_begin_anew_at_the_end_of_their_32_bits() -> None:
    seen = watched(list(range(2**32 - 5, 2**32 + 5)), 10)
    assert len(seen.rows) == 10 and seen.lost_on_line == 0
    assert (np.diff(seen.rows["step"]) == 1).all()


def test_a_silent_or_slow_one_ends_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watching, "SILENCE", 0.05)
    with pytest.raises(LinkError, match="sends no samples any more"):
        watched([5, 6], 100)
    monkeypatch.undo()
    slow = Watching(0.001, 1, 0.0).after(np.array([5], np.uint32), 0.0).after(np.array([6], np.uint32), 61.9)
    with pytest.raises(LinkError, match="1 of 100 steps in 62 s"):
        slow.check(100, 62.01)


@pytest.mark.parametrize(("step", "sound"), [(6, True), (9, True), (5, False), (0, False), (2**32 - 1, False)])
def test_a_setting_acts_neither_before_it_was_asked_for_nor_in_a_year(step: int, sound: bool) -> None:
    course = Watching(0.001, 1, 0.0).after(np.array([5, 6], np.uint32), 0.0)
    if sound:
        course.check_set("kp", step, 0.1)
        return
    with pytest.raises(LinkError, match=rf"kp is set from step {step} on, after step 6, which no run does"):
        course.check_set("kp", step, 0.1)


class Board:
    """A board that computes what it should, behind a socket, and makes up what each step cost it."""

    def __init__(self, bundle: Bundle, ticks: int, stack: int) -> None:
        self._link = LibraryLink(build_host(bundle, load_target("host")), PROGRAM)
        self._ticks, self._stack, self._session, self._steps = ticks, stack, 0, 0

    def answer(self, block: bytes) -> bytes:
        bound = binding(self._session, 0)
        kind, sequence, payload = unseal(block, bound)
        if kind == HELLO:
            self._session = int.from_bytes(payload, "little")
            said = struct.pack("<IHHHHI16s", self._session, PROTOCOL_VERSION, IN, OUT, 100, 10, PROGRAM.id.encode())
        elif kind == STEP:
            rows = np.frombuffer(self._link.step(payload, len(payload) // IN), record_type(PROGRAM)).copy()
            rows["ticks"] = 40
            if not self._steps:
                rows["ticks"][:1] = self._ticks
            self._steps += len(rows)
            said = rows.tobytes()
        else:
            self._link.reset()
            said = struct.pack("<I", self._stack) if kind == STACK else b""
        return seal(kind | 0x80, sequence, said, bound)

    def serve(self, listener: socket.socket) -> None:
        line, _ = listener.accept()
        pending = b""
        with line:
            while data := line.recv(1 << 13):
                *blocks, pending = (pending + data).split(b"\0")
                for block in filter(None, blocks):
                    line.sendall(self.answer(block))


@pytest.mark.parametrize(
    ("ticks", "stack", "cycles", "depth"),
    [(52, 64, 42, 64), (2**30, 64, None, 64), (0, 64, None, 64), (52, 50_000, 42, None)],
)
def test_costs_that_no_board_can_have_are_no_measurement(
    ticks: int, stack: int, cycles: int | None, depth: int | None
) -> None:
    """A step of a minute in a run of a second; a stack deeper than the image has."""
    law = pid(FULL)
    bundle = emit(PROGRAM, "test")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        device = threading.Thread(target=Board(bundle, ticks, stack).serve, args=(listener,), daemon=True)
        device.start()
        url = f"socket://127.0.0.1:{listener.getsockname()[1]}"
        board = load_target("nucleo_f401re")
        verdict = verify(law, PROGRAM, bundle, board, (), 200, 1, url, lambda share, doing: None)
        device.join()
    assert verdict.agrees
    assert (verdict.cost.cycles_max, verdict.cost.stack_painted_bytes) == (cycles, depth)
