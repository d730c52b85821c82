"""Keep two processes that take turns on one processor."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path


def share_one_processor() -> Callable[[], None]:
    """Bind this thread, and what it starts from now on, to the processor it runs on; return what undoes it.

    Host and emulator in lock-step never run at the same time. On one processor the kernel hands over in a few
    microseconds; across two, a sleeping one has to be woken at every turn, which takes up to 100 us on a virtual
    machine.
    """
    thread = threading.get_native_id()
    before = os.sched_getaffinity(thread)
    # Field 39 of proc(5) stat, counted from the closing parenthesis of the name, is the processor.
    processor = int(Path("/proc/thread-self/stat").read_text().rpartition(")")[2].split()[36])
    with suppress(OSError):  # a container may forbid it, and it is only for speed
        os.sched_setaffinity(thread, {processor})

    def undo() -> None:
        with suppress(OSError):  # the thread that opened the link may have ended
            os.sched_setaffinity(thread, before)

    return undo
