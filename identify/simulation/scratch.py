"""A folder for work in progress, which the next run takes away if this one was killed before it could.

Its owner holds a lock on it, which the kernel lets go of however the owner ends; what can be locked has no owner.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

# Windows has none, and its folders cannot be locked: there, the user tidies up.
fcntl: Any = import_module("fcntl") if os.name == "posix" else None
_RANDOM = 4  # bytes in a name


@dataclass(frozen=True, slots=True)
class Scratch:
    """A folder of this process's own; `lock` is the descriptor that says so, -1 where there are no locks."""

    path: Path
    lock: int

    def remove(self) -> None:
        """Take the folder away, if it is still there, and let go of it."""
        with suppress(OSError):
            shutil.rmtree(self.path, ignore_errors=True)
        if self.lock >= 0:
            with suppress(OSError):
                os.close(self.lock)


def make_scratch(parent: Path, stem: str, mode: int) -> Scratch:
    """Make a folder `stem`.random in `parent`, after sweeping away those that a killed run has left there.

    `mode` is cut by the umask, as that of any folder.
    """
    sweep(parent, stem)
    while True:
        path = parent / f"{stem}.{secrets.token_hex(_RANDOM)}"
        path.mkdir(mode=mode)
        if fcntl is None:
            return Scratch(path, -1)
        try:
            lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:  # another run took it for a leftover
            continue
        with suppress(OSError):  # a file system without locks: nobody can lock it, so nobody sweeps it
            fcntl.flock(lock, fcntl.LOCK_EX)
        if path.is_dir():
            return Scratch(path, lock)
        os.close(lock)


@contextmanager
def scratch_folder(parent: Path, stem: str) -> Iterator[Path]:
    """Give a private folder in `parent` that goes when it is left."""
    scratch = make_scratch(parent, stem, 0o700)
    try:
        yield scratch.path
    finally:
        scratch.remove()


def sweep(parent: Path, stem: str) -> None:
    """Take away the folders `stem`.random of ours in `parent` whose owner is gone."""
    if fcntl is None or not hasattr(os, "getuid") or not parent.is_dir():
        return
    random = re.compile(rf"{re.escape(stem)}\.[0-9a-f]{{{2 * _RANDOM}}}")
    with suppress(OSError), os.scandir(parent) as entries:
        left = [Path(entry.path) for entry in entries if random.fullmatch(entry.name)]
        for path in left:
            with suppress(OSError):
                _sweep_one(path)


def _sweep_one(path: Path) -> None:
    lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        if os.fstat(lock).st_uid == os.getuid():
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(lock)
