"""Sessions: what is executed once, what is refused and why, and what is not taken for an answer however it comes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from firmloop.verify.links.frame import HELLO, RESET, STEP, binding, checksum, seal, unseal
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.stream import DescriptorStream, Stream
from tests.verify.boards import DICE, ONE_STEP, PROGRAM, RESULT, build_host_image, link_to, start_host_image

SESSION = 0x04030201
BOUND = binding(SESSION, 0)  # of the first 256 exchanges
GREETING = seal(HELLO, 0, SESSION.to_bytes(4, "little"))
PATIENCE = 300.0  # s, for what comes at once on a machine with time to spare


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_host_image(tmp_path_factory.mktemp("image"))


@pytest.fixture
def stream(image: Path) -> Iterator[DescriptorStream]:
    line, _ = start_host_image(image)
    yield line
    line.close()


def sealed(kind: int, number: int, payload: bytes, session: int = SESSION) -> bytes:
    """A request of one exchange of a session."""
    return seal(kind, number & 0xFF, payload, binding(session, number))


def crc_of(kind: int, number: int, payload: bytes) -> bytes:
    return checksum(kind, number & 0xFF, payload, binding(SESSION, number)).to_bytes(4, "little")


def raw_exchange(stream: DescriptorStream, request: bytes, replies: int = 1) -> list[tuple[int, int, bytes]]:
    """Send bytes, wait for that many messages, and demand that they are all."""
    stream.write(request)
    data, deadline = b"", time.monotonic() + PATIENCE
    while len([block for block in data.split(b"\0")[:-1] if block]) < replies and time.monotonic() < deadline:
        data += stream.read(0.1)
    messages = [unseal(block, BOUND) for block in data.split(b"\0") if block]
    assert len(messages) == replies
    return messages


def test_a_request_runs_once_whatever_is_repeated(stream: DescriptorStream) -> None:
    raw_exchange(stream, GREETING)
    step = sealed(STEP, 1, ONE_STEP(1.0, 0.0))
    (first,) = raw_exchange(stream, step)
    assert raw_exchange(stream, step + step, 2) == [first, first]
    # An older request that comes late is refused, not run; so is one from the future.
    later = raw_exchange(stream, sealed(STEP, 2, ONE_STEP(1.0, 0.0)))
    assert np.frombuffer(later[0][2], RESULT)["sum"] == 2.0
    assert raw_exchange(stream, step) == [(0xFF, 1, b"\1" + crc_of(STEP, 1, ONE_STEP(1.0, 0.0)))]
    assert raw_exchange(stream, sealed(RESET, 4, b"")) == [(0xFF, 4, b"\1" + crc_of(RESET, 4, b""))]
    # A HELLO of this session that comes late neither answers nor moves the exchanges back.
    (last,) = raw_exchange(stream, GREETING + sealed(STEP, 3, ONE_STEP(1.0, 0.0)))
    assert np.frombuffer(last[2], RESULT)["sum"] == 3.0


@pytest.mark.parametrize(
    "foreign",
    [
        sealed(STEP, 1, ONE_STEP(1.0, 0.0), SESSION + 1),  # of a host that was killed, held back by the line
        sealed(RESET, 1, b"", SESSION + 1),
        sealed(STEP, 1 + 256, ONE_STEP(1.0, 0.0)),
        sealed(STEP, 256, ONE_STEP(1.0, 0.0)),
    ],
    ids=["step of another session", "reset of another session", "next but 256", "last but 256"],
)
def test_a_request_of_another_time_is_not_run(stream: DescriptorStream, foreign: bytes) -> None:
    raw_exchange(stream, GREETING)
    ((kind, _, payload),) = raw_exchange(stream, foreign)
    assert kind == 0xFF and payload[0] == 1
    (first,) = raw_exchange(stream, sealed(STEP, 1, ONE_STEP(1.0, 0.0)))
    assert np.frombuffer(first[2], RESULT)["sum"] == 1.0


@pytest.mark.parametrize(
    ("request_bytes", "reason"),
    [
        (b"\0\x05\x01\x02\0", 1),
        (sealed(STEP, 1, b"\0" * 8)[:-6] + b"\1\1\1\1\1\0", 1),
        (sealed(STEP, 1, b"\0" * 7), 3),
        (sealed(STEP, 1, b""), 3),
        (sealed(STEP, 1, b"\0" * 8 * 65), 1),  # longer than the image's memory for it
        (sealed(RESET, 1, b"x"), 3),
        (seal(HELLO, 1, b"short"), 3),
        (sealed(0x33, 1, b""), 4),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_reason(
    stream: DescriptorStream, request_bytes: bytes, reason: int
) -> None:
    raw_exchange(stream, GREETING)
    replies = raw_exchange(stream, request_bytes)
    assert [(kind, payload[0]) for kind, _, payload in replies] == [(0xFF, reason)]
    assert len(raw_exchange(stream, sealed(STEP, 1, ONE_STEP(1.0, 0.0)))) == 1


def test_more_exchanges_than_the_sequence_number_counts(stream: DescriptorStream) -> None:
    link, total = link_to(stream), 0.0
    for _ in range(600):
        results = np.frombuffer(link.step(ONE_STEP(1.0, 0.0), 1), RESULT)
        total += 1.0
        assert results["sum"] == total


class Held:
    """A stream whose far end says what a test wants it to say, before it says what it has to."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._heard = b""
        self.early = b""

    def write(self, data: bytes) -> None:
        self._stream.write(data)

    def read(self, timeout: float) -> bytes:
        early, self.early = self.early, b""
        if early:
            return early
        data = self._stream.read(timeout)
        self._heard += data
        return data

    def reply(self, number: int) -> bytes:
        """The reply to one exchange of the first session, as it came."""
        return [block for block in self._heard.split(b"\0") if block][number] + b"\0"

    def close(self) -> None:
        self._stream.close()


def open_link(line: Held) -> FramedLink:
    return FramedLink(line, "test line", PROGRAM.id, PATIENCE, attempts=2, draw=DICE.randbytes)


def test_a_late_reply_of_another_session_is_not_taken(stream: DescriptorStream) -> None:
    line = Held(stream)
    open_link(line).step(ONE_STEP(5.0, 0.0), 1)
    second = open_link(line)
    line.early = line.reply(1)  # the other's first step, which answers 5
    assert np.frombuffer(second.step(ONE_STEP(1.0, 0.0), 1), RESULT)["sum"] == 6.0


def test_a_reply_that_comes_256_exchanges_late_is_not_taken(stream: DescriptorStream) -> None:
    line = Held(stream)
    link = open_link(line)
    for _ in range(256):
        link.step(ONE_STEP(1.0, 0.0), 1)
    line.early = line.reply(1)
    assert np.frombuffer(link.step(ONE_STEP(1.0, 0.0), 1), RESULT)["sum"] == 257.0


def test_a_late_refusal_of_another_request_is_not_taken(stream: DescriptorStream) -> None:
    line = Held(stream)
    link = open_link(line)
    for reason in (2, 3, 4):
        line.early = b"\0" + seal(0xFF, 1, bytes([reason]) + b"\1\2\3\4")
        link.step(ONE_STEP(1.0, 0.0), 1)
