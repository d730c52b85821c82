"""Keep built libraries, each under a name that tells its content, so that a damaged one is never loaded.

A name is the key of what went in, a dash, and the SHA-256 of the library: one rename puts both in place.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from contextlib import suppress
from pathlib import Path

_DIGITS = 32  # of either hash in a name: 128 bits
MOST_BYTES = 256 << 20  # of all libraries; a walk builds some ten of 50 kB
IN_USE = 600.0  # s after its last use in which a library is not taken away: another run may be about to load it


def find_library(folder: Path, key: str) -> Path | None:
    """Return the sound library built for `key`, None where there is none; a damaged one is taken away."""
    for path in sorted(folder.glob(f"{_stem(key)}-*.so")):
        if path.is_symlink() or not path.is_file():
            continue
        if os.access(path, os.R_OK | os.X_OK) and path.stem.partition("-")[2] == _digest(path):
            state = path.stat()
            with suppress(OSError):
                os.utime(path, ns=(time.time_ns(), state.st_mtime_ns))  # its last use, which evict() goes by
            return path
        with suppress(OSError):
            path.unlink()
    return None


def keep_library(built: Path, folder: Path, key: str) -> Path:
    """Move a library just built into `folder`; it is on the disk before it has its name."""
    kept = folder / f"{_stem(key)}-{_digest(built)}.so"
    with built.open("rb") as stream:
        os.fsync(stream.fileno())
    if kept.is_dir() and not kept.is_symlink():  # a file cannot take its place
        shutil.rmtree(kept)
    os.replace(built, kept)
    evict(folder)
    return kept


def evict(folder: Path) -> None:
    """Take away the libraries that were not used for longest, until the others are no more than MOST_BYTES."""
    found = []
    for path in folder.glob("*.so"):
        with suppress(OSError):  # another run was faster
            state = path.stat()
            found.append((state.st_atime, state.st_size, path))
    size = sum(bytes_ for _, bytes_, _ in found)
    for used, bytes_, path in sorted(found):
        if size <= MOST_BYTES or time.time() - used < IN_USE:
            return
        with suppress(OSError):
            path.unlink()
            size -= bytes_


def _stem(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:_DIGITS]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:_DIGITS]
