"""Read a file that a user named: a regular one of bounded size, not a pipe or a device, which may never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

MOST_TEXT = 16 << 20  # bytes of a project, a target, a proof or a verdict; the largest that we write has some 2 MB


def read_regular(path: Path, most: int) -> bytes:
    """Return the bytes of a file.

    Raises
    ------
    OSError
        as the system says it; and when it is no regular file, has more than `most` bytes, or cannot be a file's name.
    """
    try:
        # O_NONBLOCK: to open a pipe without a writer waits for one, and what a path leads to may change meanwhile.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError:
        raise OSError(errno.EINVAL, "is not a file's name", ascii(str(path))) from None
    with os.fdopen(descriptor, "rb") as stream:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "is a pipe or a device, which may never end", str(path))
        content = stream.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"has more than {most:,} bytes", str(path))
    return content


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8; it raises what `read_regular` does, and UnicodeDecodeError."""
    return read_regular(path, MOST_TEXT).decode("utf-8")
