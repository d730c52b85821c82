"""A Link: the one way to run a controller elsewhere, whether in a library, in an emulator or on a board."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self


class LinkError(Exception):
    """A port, a board or the emulator failed; the message says which link, what happened and what to do."""


def fault_says(report: str) -> str:
    """Return what to tell of the fault that an image reported, and what to do where the report says it."""
    remedy = "; it needs more stack: raise stack_bytes in the target's file or choose a larger part"
    return f"the image faulted: {report}{remedy if report.endswith('stack=overrun') else ''}"


@dataclass(frozen=True, slots=True)
class Hello:
    """What the far end says of itself."""

    program_id: str
    in_bytes: int  # size of the packed input struct
    out_bytes: int  # size of the packed output struct
    steps_max: int  # most steps in one frame
    overhead_ticks: int  # what measuring itself takes


class Link(Protocol):
    """One controller behind a line."""

    def hello(self) -> Hello:
        """Return what the far end says of itself."""

    def reset(self) -> None:
        """Put the controller into its first state."""

    def step(self, inputs: bytes, count: int) -> bytes:
        """Run `count` steps over packed input structs; return (output struct, status u32, ticks u32) of each."""

    def lanes(self, inputs: bytes, lanes: int, steps: int) -> bytes:
        """Run lanes of `steps` steps behind one another, each from the first state; return what `step` does of each."""

    def close(self) -> None:
        """Let go of the far end and of everything that was started for it."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
