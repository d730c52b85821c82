"""The compiled exchange takes what the Python half would take, and leaves to it what it would not."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest

from firmloop.verify.links.exchange import ROOM, Exchange
from firmloop.verify.links.frame import HELLO, REPLY, STEP, binding, seal
from firmloop.verify.links.semihosting import open_semihosting
from tests.verify.boards import PROGRAM, RESULT, TARGET, build_qemu_image, expected, packed

BOUND = binding(7, 0)
PAYLOADS = [b"", b"\0" * 8, b"\x5a" * 300, b"\x5b" * 248, bytes(range(256)) * 8]


class Pipes:
    """Both ends of both pipes: what the far end says is put in before it is asked."""

    def __init__(self) -> None:
        self.reader, self.say = os.pipe()
        self.hear, self.writer = os.pipe()
        self.exchange = Exchange(self.reader, self.writer)

    def close(self) -> None:
        for descriptor in (self.reader, self.say, self.hear, self.writer):
            os.close(descriptor)


@pytest.fixture
def pipes() -> Iterator[Pipes]:
    both = Pipes()
    yield both
    both.close()


@pytest.mark.parametrize("payload", PAYLOADS, ids=len)
def test_request_and_reply_are_those_of_the_python_half(pipes: Pipes, payload: bytes) -> None:
    os.write(pipes.say, seal(STEP | REPLY, 9, payload + b"!", BOUND))
    assert pipes.exchange(STEP, 9, BOUND, payload) == (payload + b"!", b"")
    assert os.read(pipes.hear, ROOM) == seal(STEP, 9, payload, BOUND)


GOOD = seal(STEP | REPLY, 9, b"reply", BOUND)


@pytest.mark.parametrize(
    "came",
    [
        GOOD[:-3] + bytes([GOOD[-3] ^ 1]) + GOOD[-2:],
        GOOD[:-1],
        b"\0" + GOOD,
        GOOD + GOOD,
        b"\0",
        seal(STEP | REPLY, 9, b"reply", binding(8, 0)),
        seal(STEP | REPLY, 8, b"reply", BOUND),
        seal(STEP, 9, b"reply", BOUND),
        seal(HELLO | REPLY, 9, b"reply", BOUND),
        seal(0xFF, 9, b"\1\0\0\0\0", BOUND),
    ],
)
def test_what_is_not_the_reply_is_handed_over_as_it_came(pipes: Pipes, came: bytes) -> None:
    os.write(pipes.say, came)
    assert pipes.exchange(STEP, 9, BOUND, b"") == (None, came)


def test_a_request_too_long_for_a_pipe_is_not_sent(pipes: Pipes) -> None:
    os.set_blocking(pipes.hear, False)
    assert pipes.exchange(STEP, 9, BOUND, b"x" * 4096) == (None, None)
    with pytest.raises(BlockingIOError):
        os.read(pipes.hear, 1)


def test_an_exchange_ends_when_either_end_has_gone(pipes: Pipes) -> None:
    os.close(pipes.say)
    assert pipes.exchange(STEP, 9, BOUND, b"") == (None, b"")
    os.close(pipes.hear)
    assert pipes.exchange(STEP, 9, BOUND, b"") == (None, None)
    pipes.say, pipes.hear = os.pipe()


@pytest.mark.qemu
def test_both_ways_of_the_link_give_the_same_results(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = build_qemu_image("semihosting", tmp_path_factory.mktemp("image"))
    a, b = np.random.default_rng(3).normal(size=(2, 300)).astype(np.float32)
    inputs, seen = packed(a, b), []
    swift = Exchange.__call__

    def counted(self: Exchange, *request: int | bytes) -> tuple[bytes | None, bytes | None]:
        found = swift(self, *request)  # type: ignore[arg-type]
        seen.append(found[0] is not None)
        return found

    monkeypatch.setattr(Exchange, "__call__", counted)
    runs = []
    for compiled in (True, False):
        with open_semihosting(TARGET, image.elf, PROGRAM.id) as link:
            if not compiled:
                link._pipe = None
            replies = b"".join(link.step(inputs[at : at + 8], 1) for at in range(0, len(inputs), 8))
            runs.append(np.frombuffer(replies, RESULT))
    np.testing.assert_array_equal(runs[0][["sum", "status"]], runs[1][["sum", "status"]])
    assert seen == [True] * 300
    np.testing.assert_array_equal(runs[0]["sum"], expected(a, b, 0.0)[0])
