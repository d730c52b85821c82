"""One exchange over two pipes in one call of compiled code, for the time of Python is most of a whole exchange."""

from __future__ import annotations

import ctypes
from functools import cache

from firmloop.codegen.environment import text_of
from firmloop.codegen.firmware import WARNINGS
from firmloop.identify.simulation.compiler import shared_library

ROOM = 1 << 13  # bytes received at once
_HEADER = 2  # bytes of a message before its payload
_SOURCES = ("host_exchange.c", "support/frame.c")


class _State(ctypes.Structure):
    _fields_ = (
        ("reader", ctypes.c_int32),
        ("writer", ctypes.c_int32),
        ("received", ctypes.c_uint8 * ROOM),
        ("decoded", ctypes.c_uint8 * ROOM),
    )


class Exchange:
    """The undisturbed way from a request to its reply; what is disturbed is left to verify.links.framed."""

    def __init__(self, reader: int, writer: int) -> None:
        """Use two descriptors, or raise ToolError if there is no compiler.

        If `reader` does not block, it is asked again and again for a while before it is waited for.
        """
        self._call = _library().host_exchange
        self._state = _State(reader, writer)
        self._address = ctypes.c_void_p(ctypes.addressof(self._state))
        self._received = memoryview(self._state.received)
        self._payload = memoryview(self._state.decoded)[_HEADER:]

    def __call__(self, kind: int, sequence: int, bound: int, payload: bytes) -> tuple[bytes | None, bytes | None]:
        """Return the reply's payload; or None, and what came instead, or None if the request could not be sent."""
        size = self._call(self._address, kind + (sequence << 8), bound, payload, len(payload))
        if size >= 0:
            return self._payload[:size].tobytes(), b""
        return None, self._received[: -2 - size].tobytes() if size < -1 else None


@cache
def _library() -> ctypes.CDLL:
    files = {name: text_of(name) for name in (*_SOURCES, "support/frame.h")}
    library = ctypes.CDLL(str(shared_library(files, _SOURCES, ("-std=gnu99", "-O2", *WARNINGS))))
    function = library.host_exchange
    function.restype = ctypes.c_long  # no argtypes: to check them costs as much as all the rest of the call
    return library
