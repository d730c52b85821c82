"""The messages: what Python writes C reads, and the other way round, whatever the bytes and the damage."""

from __future__ import annotations

import ctypes
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmloop.codegen.environment import text_of
from firmloop.codegen.firmware import WARNINGS
from firmloop.identify.simulation.compiler import shared_library
from firmloop.verify.links.frame import HELLO, NAK, FrameError, binding, seal, stuff, unseal, unstuff

# Zero bytes and runs around 254 bytes are where COBS can go wrong; 0x5A is what the mask turns into a zero byte.
PAYLOADS = st.one_of(
    st.binary(max_size=600),
    st.lists(st.sampled_from([b"\0", b"\x5a", b"\x01" * 253, b"\x01" * 254, b"\x5b" * 248]), max_size=12).map(b"".join),
)
BYTES = st.integers(0, 255)
KINDS = BYTES.filter(lambda kind: kind not in (HELLO, HELLO | 0x80, NAK))  # that are bound to an exchange
WORDS = st.integers(0, 0xFFFFFFFF)
HEADROOM = 20  # of a frame of up to 4000 bytes


class CMessage(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_uint8),
        ("sequence", ctypes.c_uint8),
        ("length", ctypes.c_size_t),
        ("crc", ctypes.c_uint32),
        ("payload", ctypes.c_void_p),
    )


@pytest.fixture(scope="module")
def frame_c() -> ctypes.CDLL:
    files = {name: text_of(f"support/{name}") for name in ("frame.c", "frame.h")}
    flags = ("-std=c99", "-O2", *WARNINGS, "-fsanitize=undefined", "-fno-sanitize-recover=undefined")
    library = ctypes.CDLL(str(shared_library(files, ["frame.c"], flags)))
    library.frame_crc32.restype = ctypes.c_uint32
    library.frame_crc32.argtypes = (ctypes.c_uint32, ctypes.c_char_p, ctypes.c_size_t)
    library.frame_seal.restype = ctypes.c_size_t
    byte, size, word = ctypes.c_uint8, ctypes.c_size_t, ctypes.c_uint32
    library.frame_seal.argtypes = (ctypes.c_void_p, size, byte, byte, size, word)
    library.frame_open.restype = ctypes.c_bool
    library.frame_open.argtypes = (ctypes.c_void_p, size, ctypes.POINTER(CMessage))
    library.frame_whole.restype = ctypes.c_bool
    library.frame_whole.argtypes = (ctypes.POINTER(CMessage), word)
    return library


def opened_by_c(frame_c: ctypes.CDLL, block: bytes, bound: int = 0) -> tuple[int, int, bytes] | None:
    memory = ctypes.create_string_buffer(block, max(len(block), 1))
    message = CMessage()
    if not frame_c.frame_open(memory, len(block), message) or not frame_c.frame_whole(message, bound):
        return None
    return message.type, message.sequence, ctypes.string_at(message.payload, message.length)


def opened_by_python(block: bytes, bound: int = 0) -> tuple[int, int, bytes] | None:
    try:
        return unseal(block, bound)
    except FrameError:
        return None


@given(st.binary(max_size=1200))
def test_stuffing_is_undone_and_leaves_no_zero(data: bytes) -> None:
    block = stuff(data)
    assert 0 not in block
    assert len(block) <= len(data) + len(data) // 254 + 1
    assert unstuff(block) == data


@given(WORDS, PAYLOADS)
def test_crc_is_that_of_zlib(frame_c: ctypes.CDLL, before: int, data: bytes) -> None:
    assert frame_c.frame_crc32(before, data, len(data)) == crc32(data, before)


@given(KINDS, BYTES, PAYLOADS, WORDS)
def test_c_and_python_write_the_same_frame(
    frame_c: ctypes.CDLL, kind: int, sequence: int, payload: bytes, bound: int
) -> None:
    memory = ctypes.create_string_buffer(HEADROOM + len(payload) + 64)
    memory[HEADROOM + 2 : HEADROOM + 2 + len(payload)] = payload
    size = frame_c.frame_seal(memory, HEADROOM, kind, sequence, len(payload), bound)
    assert memory.raw[:size] == seal(kind, sequence, payload, bound)


@given(KINDS, BYTES, PAYLOADS, WORDS)
def test_c_and_python_read_each_other(
    frame_c: ctypes.CDLL, kind: int, sequence: int, payload: bytes, bound: int
) -> None:
    block = seal(kind, sequence, payload, bound)[:-1]
    assert 0 not in block
    assert opened_by_python(block, bound) == (kind, sequence, payload)
    assert opened_by_c(frame_c, block, bound) == (kind, sequence, payload)


@given(KINDS, BYTES, PAYLOADS, WORDS, WORDS, st.sampled_from([256, 512, 65_536, 1 << 24]), WORDS.filter(bool))
def test_a_whole_message_of_another_time_is_none(
    frame_c: ctypes.CDLL, kind: int, sequence: int, payload: bytes, session: int, number: int, late: int, other: int
) -> None:
    block = seal(kind, sequence, payload, binding(session, number))[:-1]
    for bound in (binding(session, (number + late) & 0xFFFFFFFF), binding(session ^ other, number)):
        assert opened_by_python(block, bound) is None
        assert opened_by_c(frame_c, block, bound) is None


@pytest.mark.parametrize("kind", [HELLO, HELLO | 0x80, NAK])
def test_what_may_come_before_a_session_is_bound_to_none(kind: int) -> None:
    assert seal(kind, 3, b"x", binding(1, 2)) == seal(kind, 3, b"x")
    assert unseal(seal(kind, 3, b"x")[:-1], binding(1, 2)) == (kind, 3, b"x")


@given(BYTES, PAYLOADS, st.data())
def test_damage_is_seen_by_both(frame_c: ctypes.CDLL, sequence: int, payload: bytes, data: st.DataObject) -> None:
    block = bytearray(seal(3, sequence, payload)[:-1])
    place = data.draw(st.integers(0, len(block) - 1))
    block[place] = data.draw(st.integers(1, 255).filter(lambda byte: byte != block[place]))
    assert opened_by_python(bytes(block)) is None
    assert opened_by_c(frame_c, bytes(block)) is None


@given(st.binary(max_size=300).map(lambda data: data.replace(b"\0", b"")))
def test_noise_is_no_message(frame_c: ctypes.CDLL, noise: bytes) -> None:
    assert opened_by_python(noise) is None
    assert opened_by_c(frame_c, noise) is None


@given(PAYLOADS, st.data())
def test_a_frame_cut_short_is_no_other_message(frame_c: ctypes.CDLL, payload: bytes, data: st.DataObject) -> None:
    block = seal(3, 1, payload)[:-1]
    cut = block[: data.draw(st.integers(0, len(block) - 1))]
    # After a block of 254 bytes COBS ends in a byte that says nothing more; without it the message is still whole.
    whole = (3, 1, payload) if block == cut + b"\x01" and block[-256:-255] == b"\xff" else None
    assert opened_by_python(cut) in (None, whole)
    assert opened_by_c(frame_c, cut) in (None, whole)
