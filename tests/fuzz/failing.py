"""Run a command in a process of its own that loses its power, its disk or its memory at a chosen time."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Sequence
from types import FrameType

from firmloop.cli import main

OURS = f"{os.sep}firmloop{os.sep}"  # in the path of every file of ours
DEAD = 99  # exit status of one without power
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate", "shutil.rmtree")
_WRITING = os.O_WRONLY | os.O_RDWR


def count_changes(argv: Sequence[str]) -> tuple[int, int]:
    """Run a command undisturbed; return its exit status and how often it changes a file."""
    reader, writer = os.pipe()
    seen = []

    def note() -> None:
        seen.append(1)

    status = _run(argv, note, lambda: os.write(writer, len(seen).to_bytes(4, "little")))
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        return status, int.from_bytes(pipe.read(), "little")


def without_power(argv: Sequence[str], at: int) -> int:
    """Run a command that ends without a word before its change number `at`; return its exit status."""
    seen = []

    def end() -> None:
        seen.append(1)
        if len(seen) == at:
            os._exit(DEAD)

    return _run(argv, end, lambda: None)


def without_room(argv: Sequence[str], at: int) -> int:
    """Run a command for which the disk is full from its change number `at` on; return its exit status."""
    seen = []

    def refuse() -> None:
        seen.append(1)
        if len(seen) >= at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return _run(argv, refuse, lambda: None)


def count_calls(argv: Sequence[str]) -> int:
    """Run a command undisturbed; return how often it calls one of our functions."""
    reader, writer = os.pipe()
    seen = []
    status = _called(argv, lambda: seen.append(1), lambda: os.write(writer, len(seen).to_bytes(4, "little")))
    os.close(writer)
    assert status == 0
    with os.fdopen(reader, "rb") as pipe:
        return int.from_bytes(pipe.read(), "little")


def without_memory(argv: Sequence[str], at: int) -> int:
    """Run a command for which memory runs out in call number `at` of our functions; return its exit status."""
    seen = []

    def refuse() -> None:
        seen.append(1)
        if len(seen) == at:
            raise MemoryError

    return _called(argv, refuse, lambda: None)


def _called(argv: Sequence[str], call: Callable[[], None], finish: Callable[[], object]) -> int:
    def hook(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and OURS in frame.f_code.co_filename:
            call()

    def prepare() -> None:
        sys.setprofile(hook)

    def end() -> None:
        sys.setprofile(None)
        finish()

    return _forked(argv, prepare, end)


def _run(argv: Sequence[str], change: Callable[[], None], finish: Callable[[], object]) -> int:
    def hook(event: str, arguments: tuple[object, ...]) -> None:
        writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING
        if (writes and str(arguments[0]) != os.devnull) or event in CHANGES:
            change()

    return _forked(argv, lambda: sys.addaudithook(hook), finish)


def _forked(argv: Sequence[str], prepare: Callable[[], None], finish: Callable[[], object]) -> int:
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    status = DEAD
    try:
        with open(os.devnull, "w") as nowhere:
            sys.stdout = sys.stderr = nowhere
            prepare()
            status = main(argv)
            finish()
    finally:
        os._exit(status)
