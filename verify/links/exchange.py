"""One exchange over two pipes in one call of compiled code, for the time of Python is most of a whole exchange."""

from __future__ import annotations

import ctypes
from functools import cache

from codegen.environment import text_of
from codegen.firmware import WARNINGS
from identify.compiler import shared_library

ROOM = 1 << 13  # bytes received at once
_HEADER = 2  # bytes of a message before its payload
_SOURCES = ("host_exchange.c", "support/frame.c")


class Exchange:
    """The undisturbed way from a request to its reply; what is disturbed is left to verify.links.framed."""

    def __init__(self, reader: int, writer: int) -> None:
        """Use two descriptors, of which `reader` blocks, or raise ToolError if there is no compiler."""
        self._call = _library().host_exchange
        self._reader, self._writer = reader, writer
        self._received = ctypes.create_string_buffer(ROOM)
        self._reply = ctypes.create_string_buffer(ROOM)
        self._payload = ctypes.addressof(self._reply) + _HEADER

    def __call__(self, kind: int, sequence: int, bound: int, payload: bytes) -> tuple[bytes | None, bytes | None]:
        """Return the reply's payload; or None, and what came instead, or None if the request could not be sent."""
        size = self._call(
            self._reader, self._writer, kind, sequence, bound, payload, len(payload), self._received, self._reply
        )
        if size >= 0:
            return ctypes.string_at(self._payload, size), b""
        return None, self._received.raw[: -2 - size] if size < -1 else None


@cache
def _library() -> ctypes.CDLL:
    files = {name: text_of(name) for name in (*_SOURCES, "support/frame.h")}
    library = ctypes.CDLL(str(shared_library(files, _SOURCES, ("-std=gnu99", "-O2", *WARNINGS))))
    function = library.host_exchange
    function.restype = ctypes.c_long
    word, size, memory = ctypes.c_uint32, ctypes.c_size_t, ctypes.c_char_p
    function.argtypes = (ctypes.c_int, ctypes.c_int, word, word, word, memory, size, memory, memory)
    return library
