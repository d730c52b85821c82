"""The link into this process: the controller as a shared library, its memory ours."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import TracebackType
from typing import Self

from firmloop.quantize.program import Program
from firmloop.verify.link import Hello, LinkError

STEPS_MAX = 1 << 16
FILLS = (0x7F, 0xFF)  # repeated: a number near the largest of any type, and none, or -1


class LibraryLink:
    """A controller loaded from a library that `verify/build/host.py` built."""

    def __init__(self, library: Path, program: Program) -> None:
        try:
            self._library = ctypes.CDLL(str(library))
        except OSError as error:
            raise LinkError(f"the library of {program.name} cannot be loaded: {error}") from None
        self._program, self._resets = program, 0
        self._in_bytes = sum(v.number.bits // 8 for v in (*program.inputs, *program.parameters))
        self._record = sum(v.number.bits // 8 for v in program.outputs) + 8
        self._library.host_state_bytes.restype = ctypes.c_uint32
        self._memory = ctypes.create_string_buffer(self._library.host_state_bytes())

    def hello(self) -> Hello:
        """Return the sizes; the program is the one that was built."""
        return Hello(self._program.id, self._in_bytes, self._record - 8, STEPS_MAX, 0)

    def reset(self) -> None:
        """Call init(), on memory that holds large numbers or none, by turns: what init() leaves out shows."""
        ctypes.memset(self._memory, FILLS[self._resets % len(FILLS)], len(self._memory))
        self._resets += 1
        self._library.host_init(self._memory)

    def step(self, inputs: bytes, count: int) -> bytes:
        """Run `count` steps; the tick counts are zero."""
        self._whole(inputs, count)
        out = ctypes.create_string_buffer(count * self._record)
        self._library.host_steps(self._memory, inputs, out, ctypes.c_uint32(count))
        return out.raw

    def lanes(self, inputs: bytes, lanes: int, steps: int) -> bytes:
        """Run lanes of `steps` steps, each from its own call of init() on memory that holds one of FILLS by turns."""
        self._whole(inputs, lanes * steps)
        out = ctypes.create_string_buffer(lanes * steps * self._record)
        fills = bytes(FILLS[(self._resets + k) % 2] for k in range(2))
        self._library.host_lanes(self._memory, inputs, out, ctypes.c_uint32(lanes), ctypes.c_uint32(steps), fills)
        self._resets += lanes
        return out.raw

    def step_from(self, states: bytes, size: int, inputs: bytes, count: int) -> tuple[bytes, bytes]:
        """Run one step from each of `count` states of `size` bytes; return the answers and the states they leave."""
        if size != len(self._memory):
            raise LinkError(f"a state of {self._program.name} has {len(self._memory)} bytes, not {size}")
        self._whole(inputs, count)
        out = ctypes.create_string_buffer(count * self._record)
        left = ctypes.create_string_buffer(count * size)
        self._library.host_departures(self._memory, states, inputs, out, left, ctypes.c_uint32(count))
        return out.raw, left.raw

    def _whole(self, inputs: bytes, steps: int) -> None:
        if len(inputs) != steps * self._in_bytes:
            raise LinkError(f"{steps} steps need {steps * self._in_bytes} bytes of input, got {len(inputs)}")

    def close(self) -> None:
        """Do nothing: the library stays loaded until the process ends."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
