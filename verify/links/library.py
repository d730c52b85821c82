"""The link into this process: the controller as a shared library, its memory ours."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import TracebackType
from typing import Self

from quantize.program import Program
from verify.links import Hello, LinkError

STEPS_MAX = 1 << 16


class LibraryLink:
    """A controller loaded from a library that `verify/host.py` built."""

    def __init__(self, library: Path, program: Program) -> None:
        try:
            self._library = ctypes.CDLL(str(library))
        except OSError as error:
            raise LinkError(f"the library of {program.name} cannot be loaded: {error}") from None
        self._program = program
        self._in_bytes = sum(v.number.bits // 8 for v in (*program.inputs, *program.parameters))
        self._record = sum(v.number.bits // 8 for v in program.outputs) + 8
        self._library.host_state_bytes.restype = ctypes.c_uint32
        self._memory = ctypes.create_string_buffer(self._library.host_state_bytes())

    def hello(self) -> Hello:
        """Return the sizes; the program is the one that was built."""
        return Hello(self._program.id, self._in_bytes, self._record - 8, STEPS_MAX, 0)

    def reset(self) -> None:
        """Call init()."""
        self._library.host_init(self._memory)

    def step(self, inputs: bytes, count: int) -> bytes:
        """Run `count` steps; the tick counts are zero."""
        if len(inputs) != count * self._in_bytes:
            raise LinkError(f"{count} steps need {count * self._in_bytes} bytes of input, got {len(inputs)}")
        out = ctypes.create_string_buffer(count * self._record)
        self._library.host_steps(self._memory, inputs, out, ctypes.c_uint32(count))
        return out.raw

    def close(self) -> None:
        """Do nothing: the library stays loaded until the process ends."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
