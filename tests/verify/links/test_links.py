"""The line: whatever it does to the bytes, no step runs twice, no wrong value comes through, and nothing hangs."""

from __future__ import annotations

import os
import pty
import random
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import STEP, seal
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.stream import DescriptorStream, Stream
from firmloop.verify.links.uart import open_port
from tests.verify.boards import (
    ONE_STEP,
    PROGRAM,
    RESULT,
    TARGET,
    build_host_image,
    expected,
    link_to,
    packed,
    start_host_image,
)

Damage = Callable[[bytes, random.Random], bytes]


def flip(data: bytes, dice: random.Random) -> bytes:
    place = dice.randrange(len(data))
    return data[:place] + bytes([data[place] ^ (1 << dice.randrange(8))]) + data[place + 1 :]


def drop(data: bytes, dice: random.Random) -> bytes:
    place = dice.randrange(len(data))
    return data[:place] + data[place + 1 :]


def double(data: bytes, dice: random.Random) -> bytes:
    return data + data


def cut(data: bytes, dice: random.Random) -> bytes:
    return data[: dice.randrange(len(data))]


def junk(data: bytes, dice: random.Random) -> bytes:
    return dice.randbytes(dice.randrange(1, 60)) + data + dice.randbytes(dice.randrange(60))


def lose(data: bytes, dice: random.Random) -> bytes:
    return b""


def overlong(data: bytes, dice: random.Random) -> bytes:
    return b"\x01" * 5000 + data


DAMAGES: tuple[Damage, ...] = (flip, drop, double, cut, junk, lose, overlong)


PATIENCE = 300.0  # s, for what comes at once on a machine with time to spare


class BadLine:
    """A stream that damages some of what passes, either way, and holds some of it back until later."""

    def __init__(self, stream: Stream, damages: tuple[Damage, ...], share: float, seed: int) -> None:
        self._stream = stream
        self._damages = damages
        self._share = share
        self._dice = random.Random(seed)
        self._late = b""

    def _pass(self, data: bytes) -> bytes:
        if data and self._dice.random() < self._share:
            data = self._dice.choice(self._damages)(data, self._dice)
        return data

    def write(self, data: bytes) -> None:
        late, self._late = self._late, b""
        if self._share and self._dice.random() < self._share / 4:
            self._late = data  # a copy that arrives with the next request, after it was repeated
        self._stream.write(self._pass(data) + late)

    def read(self, timeout: float) -> bytes:
        return self._pass(self._stream.read(timeout))

    def close(self) -> None:
        self._stream.close()


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_host_image(tmp_path_factory.mktemp("image"))


@pytest.fixture
def stream(image: Path) -> Iterator[DescriptorStream]:
    line, _ = start_host_image(image)
    yield line
    line.close()


def check_steps(link: FramedLink, seed: int, count: int, largest: int) -> None:
    """Run `count` frames and demand every result, which depends on each step having run exactly once."""
    numbers = np.random.default_rng(seed)
    link.reset()
    total = 0.0
    for _ in range(count):
        size = int(numbers.integers(1, largest + 1))
        a, b = numbers.normal(size=(2, size)).astype(np.float32)
        results = np.frombuffer(link.step(packed(a, b), size), RESULT)
        outputs, total = expected(a, b, total)
        np.testing.assert_array_equal(results["sum"], outputs)
        np.testing.assert_array_equal(results["status"], b > 1.0)


def test_the_hello_of_an_image_tells_program_and_sizes(stream: DescriptorStream) -> None:
    hello = link_to(stream).hello()
    assert (hello.program_id, hello.in_bytes, hello.out_bytes, hello.steps_max) == (PROGRAM.id, 8, 4, 64)
    assert hello.overhead_ticks == 1


def test_an_undamaged_line_gives_every_value(stream: DescriptorStream) -> None:
    check_steps(link_to(stream), seed=1, count=200, largest=200)  # more than one frame holds


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_damaged_line_gives_every_value(stream: DescriptorStream, damage: Damage) -> None:
    check_steps(link_to(BadLine(stream, (damage,), share=0.1, seed=2)), seed=2, count=150, largest=8)


def test_a_line_with_every_damage_at_once_gives_every_value(stream: DescriptorStream) -> None:
    check_steps(link_to(BadLine(stream, DAMAGES, share=0.2, seed=3)), seed=3, count=400, largest=40)


def test_a_new_session_takes_over_from_a_host_that_broke_off(stream: DescriptorStream) -> None:
    first = link_to(stream)
    first.step(ONE_STEP(1.0, 0.0), 1)
    stream.write(seal(STEP, 2, ONE_STEP(5.0, 0.0))[:-4])  # killed in the middle of a request
    check_steps(link_to(stream), seed=4, count=20, largest=4)


def test_an_image_that_was_reset_meanwhile_is_noticed(image: Path) -> None:
    old, _ = start_host_image(image)
    link = link_to(old)
    new, _ = start_host_image(image)
    link._stream = new  # the same line, with a board that has just come up behind it
    with pytest.raises(LinkError, match="test line: the image knows nothing of this session: it was reset"):
        link.step(ONE_STEP(1.0, 0.0), 1)
    old.close()
    new.close()


def test_an_image_of_another_program_is_refused(stream: DescriptorStream) -> None:
    with pytest.raises(LinkError, match=f"the image runs program {PROGRAM.id}, this project's is 0123456789abcdef: re"):
        FramedLink(stream, "test line", "0123456789abcdef", timeout=PATIENCE, attempts=2)


def test_silence_ends_in_bounded_time(stream: DescriptorStream) -> None:
    silent = BadLine(stream, (lose,), share=1.0, seed=0)
    begin = time.monotonic()
    with pytest.raises(LinkError, match=r"no reply within 3 attempts of 0\.1 s"):
        FramedLink(silent, "test line", PROGRAM.id, timeout=0.1, attempts=3)
    assert time.monotonic() - begin < PATIENCE


def test_a_far_end_that_dies_is_noticed(image: Path) -> None:
    stream, process = start_host_image(image)
    with link_to(stream) as link:
        link.reset()
        process.kill()
        process.wait()
        with pytest.raises(LinkError, match="host image: it is gone"):
            link.step(ONE_STEP(1.0, 0.0), 1)


def test_inputs_of_the_wrong_size_are_a_mistake_of_the_caller(stream: DescriptorStream) -> None:
    link = link_to(stream)
    with pytest.raises(LinkError, match="2 steps take 16 bytes of inputs there, not 8"):
        link.step(ONE_STEP(1.0, 0.0), 2)


def test_a_fault_report_is_quoted(stream: DescriptorStream) -> None:
    class Faulting:
        def write(self, data: bytes) -> None:
            return None

        def read(self, timeout: float) -> bytes:
            return b"FAULT icsr=00000803 cfsr=00008200 pc=00000123\n\0"

        def close(self) -> None:
            return None

    with pytest.raises(LinkError, match=r"test line: the image faulted: FAULT icsr=00000803 .* pc=00000123"):
        link_to(Faulting())


class Terminal:
    """A pseudo-terminal with the image behind it, as a board's serial port is."""

    def __init__(self, stream: DescriptorStream) -> None:
        self._stream = stream
        self._master, self._slave = pty.openpty()
        self.path = os.ttyname(self._slave)
        self._going = True
        self._relays = [threading.Thread(target=relay) for relay in (self._to_image, self._to_host)]
        for relay in self._relays:
            relay.start()

    def _to_image(self) -> None:
        while self._going:
            try:
                self._stream.write(os.read(self._master, 4096))
            except OSError:
                return

    def _to_host(self) -> None:
        while self._going:
            data = self._stream.read(0.05)
            if data:
                os.write(self._master, data)

    def unplug(self) -> None:
        if self._going:
            self._going = False
            self._relays[1].join()
            os.write(self._slave, b"\n")  # wakes the other relay
            self._relays[0].join()
            os.close(self._slave)
            os.close(self._master)


@pytest.fixture
def terminal(stream: DescriptorStream) -> Iterator[Terminal]:
    port = Terminal(stream)
    yield port
    port.unplug()


def test_a_serial_port_gives_every_value(terminal: Terminal) -> None:
    with open_port(TARGET, terminal.path, PROGRAM.id) as link:
        check_steps(link, seed=5, count=50, largest=8)


def test_a_port_that_is_unplugged_is_told(terminal: Terminal) -> None:
    with open_port(TARGET, terminal.path, PROGRAM.id) as link:
        link.reset()
        terminal.unplug()
        with pytest.raises(LinkError, match=f"port {terminal.path}: it is gone"):
            link.step(ONE_STEP(1.0, 0.0), 1)


@pytest.mark.parametrize("url", ["/dev/no_such_port", "socket://127.0.0.1:1", "nonsense://x"])
def test_a_port_that_is_not_there_is_refused(url: str) -> None:
    with pytest.raises(LinkError, match=f"port {url}: .* cannot be opened"):
        open_port(TARGET, url, PROGRAM.id)
