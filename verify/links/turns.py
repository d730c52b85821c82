"""Two ways in which host and emulator take turns: wait for each other, or, over a pipe, ask again and again.

Waiting, they share one processor: they never run at the same time, and the kernel hands over in a few microseconds,
where to wake one that sleeps on another processor takes up to 100 us on a virtual machine. Asking, each has a processor
of its own and nobody sleeps, which is faster still if both processors are free, and much slower if they are not.
"""

from __future__ import annotations

import ctypes
import math
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from firmloop.codegen.target import Target

_PIDFD_GETFD = 438  # the number of this system call of Linux, on every processor that Python runs on
_FIRST, _TRY, _LONG = 2048, 256, 65536  # exchanges: before the first try, of a try, between two; the last some 0.7 s


class Way(Protocol):
    """What changes from waiting to asking and back."""

    def ask(self) -> bool:
        """Have both ends ask; return False, with nothing changed, if that cannot be."""

    def wait(self) -> None:
        """Have both ends wait."""


class Processors:
    """Where this thread, and what it starts from now on, runs: at first on one processor, where it happens to be."""

    def __init__(self) -> None:
        self._thread = threading.get_native_id()
        self._all, self._shared = _processors(self._thread)
        self.together()

    def together(self) -> None:
        """Bring the thread back to the processor that it started others on."""
        self._move(self._shared)

    def apart(self) -> bool:
        """Take the thread away from there; return False if it may run nowhere else."""
        others = self._all - self._shared
        return bool(others) and self._move(others)

    def undo(self) -> None:
        """Let the thread run wherever it was allowed to before."""
        self._move(self._all)

    def _move(self, processors: set[int]) -> bool:
        try:
            os.sched_setaffinity(self._thread, processors)
        except (AttributeError, OSError):  # only Linux can; a container may forbid it; or the thread has ended
            return False
        return True


def _processors(thread: int) -> tuple[set[int], set[int]]:
    """Return the processors that a thread may run on and the one where it is; none where the system does not tell."""
    try:
        # Field 39 of proc(5) stat, counted from the closing parenthesis of the name, is the processor.
        here = int(Path("/proc/thread-self/stat").read_text().rpartition(")")[2].split()[36])
        return os.sched_getaffinity(thread), {here}
    except (AttributeError, OSError):
        return set(), set()


def share_processor(target: Target) -> Callable[[], None]:
    """Keep this thread, and what it starts from now on, on one processor; return what undoes that.

    It is done only if an image on `target` sleeps until its UART has a byte: one that asks leaves no time to others.
    """
    if target.uart is None or target.uart.interrupt is None:
        return lambda: None
    return Processors().undo


class PipeTurns:
    """The way of a host and of an emulator that reads the pipe whose other end is `writer`."""

    def __init__(self, processors: Processors, process: int, reader: int, writer: int) -> None:
        """Take the emulator's process id and our ends of the pipes from and to it."""
        self._processors = processors
        self._process = process
        self._reader = reader
        self._pipe = os.fstat(writer).st_ino

    def ask(self) -> bool:
        """Have both ends ask; return False, with nothing changed, if that cannot be."""
        if not self._processors.apart():
            return False
        if not self.set_emulator_blocking(False):
            self._processors.together()
            return False
        os.set_blocking(self._reader, False)
        return True

    def wait(self) -> None:
        """Have both ends wait."""
        self.set_emulator_blocking(True)
        os.set_blocking(self._reader, True)
        self._processors.together()

    def set_emulator_blocking(self, blocking: bool) -> bool:
        """Say whether a read of the emulator waits for bytes; return False if that cannot be."""
        done = False
        with suppress(AttributeError, OSError):  # only Linux can; it has ended, or the kernel does not let us
            process = os.pidfd_open(self._process)
            try:
                folder = Path(f"/proc/{self._process}/fd")
                for entry in folder.iterdir():
                    if entry.stat().st_ino == self._pipe:
                        done |= _set_blocking(process, int(entry.name), blocking)
            finally:
                os.close(process)
        return done


def _set_blocking(process: int, descriptor: int, blocking: bool) -> bool:
    # Whether a read waits belongs to what is open, not to the descriptor, so that a copy of ours changes theirs.
    copy = ctypes.CDLL(None).syscall(_PIDFD_GETFD, process, descriptor, 0)
    if copy < 0:
        return False
    try:
        os.set_blocking(copy, blocking)
    finally:
        os.close(copy)
    return True


class Turns:
    """Keeps to the way that took less time, and tries the other now and then, for what is faster may change.

    However busy the machine is, asking costs little: it ends as soon as waiting would have been faster by a try.
    """

    def __init__(self, way: Way, now: float) -> None:
        """Begin at the time `now`, in s, with waiting, which is right at any load."""
        self._way = way
        self._cost = {True: math.inf, False: math.inf}  # s of one exchange if asking or not, as it was last
        self.asking = False
        self._begin(_FIRST, now)

    def count(self, now: float) -> None:
        """Count one exchange that begins at the time `now`."""
        self.left -= 1
        if not self.left or now > self._limit:
            self._decide(now)
        elif self.asking and not self.left % _TRY:
            self._allow()

    def _decide(self, now: float) -> None:
        self._cost[self.asking] = (now - self._since) / (self._stay - self.left)
        if self._stay == _TRY:
            if self._cost[not self.asking] < self._cost[self.asking]:
                self._change()
            self._begin(_LONG, now)
        else:
            self._change()
            self._begin(_TRY, now)

    def _change(self) -> None:
        if self.asking:
            self._way.wait()
            self.asking = False
        else:
            self.asking = self._way.ask()

    def _begin(self, stay: int, now: float) -> None:
        self._stay = self.left = stay  # exchanges
        self._since = now
        self._limit = math.inf
        if self.asking:
            self._allow()

    def _allow(self) -> None:
        """Give as much time until the next look as waiting would have taken since the begin."""
        self._limit = self._since + (self._stay - self.left + _TRY) * self._cost[False]
