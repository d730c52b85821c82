"""The messages between the host and an image: COBS blocks between zero bytes, closed by a CRC-32.

message   type u8, sequence u8, payload, CRC-32 of the binding and of all before it; all little-endian
binding   session u32, number of the exchange u32 without its lowest byte, which is `sequence`; covered by the CRC, but
          not sent; nothing at all for HELLO, its reply, and NAK
on line   COBS(message with every byte xor 0x5A), 0x00; the xor makes zero bytes rare, which numbers are full of and
          which cost the host most of its time. What may follow noise has a zero byte before it, which ends the noise:
          HELLO, NAK, and whatever is sent again

request        payload                          reply type = request type | 0x80, same sequence
HELLO  0x01    session u32, drawn by the host   session u32, protocol u16, input bytes u16, output bytes u16,
                                                most steps per frame u16, overhead u32 (ticks of measuring nothing),
                                                program id (16 characters)
RESET  0x02    none                             none; the controller was initialized
STEP   0x03    n packed input structs           n times (packed output struct, status u32, ticks u32)
STACK  0x04    n packed input structs           deepest stack in bytes u32 of one step; the controller is initialized
NAK    0xFF    (a reply only)                   reason u8: 1 damaged, out of sequence or of another session,
                                                2 no session, 3 wrong size, 4 unknown type;
                                                CRC-32 of the request as it came u32, 0 if it had none

A request is executed at most once. HELLO with a new session number starts a session and is its exchange 0. In a
session, the image accepts the exchange after the last one; the last one again is answered from memory without
executing anything; any other is refused. So the host may repeat a request whose reply was lost. By the binding, a late
copy of an older message, of this session or of one before, is no message at all. What a NAK speaks of is told by the
CRC it repeats: only an image that was reset since has no session for a request of the session it greeted.

COBS: Cheshire and Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Trans. Networking 7(2), 1999.
The image's half is templates_c/support/frame.c and templates_c/main.c.j2.
"""

from __future__ import annotations

import struct
from zlib import crc32

PROTOCOL_VERSION = 2

HELLO, RESET, STEP, STACK = 0x01, 0x02, 0x03, 0x04
REPLY = 0x80
NAK = 0xFF
REASONS = {1: "damaged", 2: "no session", 3: "wrong size", 4: "unknown type"}
NAK_DAMAGED, NAK_SESSION = 1, 2
REFUSAL = struct.Struct("<BI")  # payload of NAK

_BINDING = struct.Struct("<II")
_UNBOUND = frozenset({HELLO, HELLO | REPLY, NAK})
_HEADER = struct.Struct("<BB")
_TRAILER = struct.Struct("<I")
_OVERHEAD = _HEADER.size + _TRAILER.size
_FULL = 254  # data bytes of the longest COBS block
_MASK = bytes(byte ^ 0x5A for byte in range(256))
_CODES = [bytes([length + 1]) for length in range(_FULL + 1)]


class FrameError(Exception):
    """A block between zero bytes that is no message; it was damaged on its way."""


def stuff(data: bytes) -> bytes:
    """Return `data` without zero bytes (COBS)."""
    if len(data) < _FULL:
        # Here no run can be full, so that the blocks are the runs between the zero bytes.
        return b"".join([_CODES[len(run)] + run for run in data.split(b"\0")])
    blocks = []
    for run in data.split(b"\0"):
        while len(run) >= _FULL:
            blocks.append(b"\xff" + run[:_FULL])
            run = run[_FULL:]
        blocks.append(_CODES[len(run)] + run)
    return b"".join(blocks)


def unstuff(block: bytes) -> bytes:
    """Undo `stuff` on a block that holds no zero byte, or raise FrameError."""
    data = bytearray(block)
    at, end = 0, len(data)
    full = []  # places of codes that stand for no zero byte
    while at < end:
        code = data[at]
        data[at] = 0
        if code == 255:
            full.append(at + code)
        at += code
    if at != end or not end:
        raise FrameError("a block ends early")
    for place in reversed(full):
        del data[place : place + 1]
    return bytes(data[1:])


def binding(session: int, number: int) -> int:
    """Return the CRC-32 that the messages of exchange `number` go on from."""
    return crc32(_BINDING.pack(session, number >> 8))


def checksum(kind: int, sequence: int, payload: bytes, bound: int = 0) -> int:
    """Return the CRC-32 of one message."""
    return crc32(_HEADER.pack(kind, sequence) + payload, 0 if kind in _UNBOUND else bound)


def seal(kind: int, sequence: int, payload: bytes, bound: int = 0) -> bytes:
    """Return the bytes of one message as they go onto the line; `bound` is what `binding` says of its exchange."""
    covered = _HEADER.pack(kind, sequence) + payload
    crc = crc32(covered, 0 if kind in _UNBOUND else bound)
    return stuff((covered + _TRAILER.pack(crc)).translate(_MASK)) + b"\0"


def unseal(block: bytes, bound: int = 0) -> tuple[int, int, bytes]:
    """Return type, sequence and payload of one block (without its zero byte), or raise FrameError."""
    data = unstuff(block).translate(_MASK)
    # The CRC-32 of any bytes followed by their own CRC-32 is this constant.
    if len(data) < _OVERHEAD or crc32(data, 0 if data[0] in _UNBOUND else bound) != 0x2144DF1C:
        raise FrameError("a message has another CRC than it says")
    return data[0], data[1], data[2:-4]
