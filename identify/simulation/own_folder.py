"""Check that a folder is this user's alone, so that a library in it may be loaded and run."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_MOST_LINKS = 40  # as many as Linux follows


def why_not_own(folder: Path) -> str | None:
    """Say what lets somebody else put a file into `folder`, an absolute path that is there; None if nothing does.

    The folder itself must be a real one, of this user's, that nobody else can write. Of the folders and links above it,
    none may be another user's or open to all, but for those where only the owner of an entry may rename it, as in /tmp.
    """
    if not hasattr(os, "getuid"):
        return None  # Windows: files have no owner's number, and the user's own folder for temporary files is private
    state = folder.lstat()
    if stat.S_ISLNK(state.st_mode):
        return f"{folder} is a link"
    if not stat.S_ISDIR(state.st_mode):
        return f"{folder} is no folder"
    if state.st_uid != os.getuid():
        return f"{folder} belongs to another user"
    if state.st_mode & _BY_OTHERS:
        return f"{folder} can be written by others"
    return _why_not_above(folder.parent)


def _why_not_above(folder: Path) -> str | None:
    """Walk every folder and link from the root to `folder`, as the kernel does."""
    trusted = {os.getuid(), 0, os.stat("/").st_uid}  # in a container, the root's owner may have another number
    place, left, links = Path("/"), list(folder.parts[1:]), 0
    while True:
        state = place.lstat()
        if state.st_uid not in trusted:
            return f"{place} belongs to another user"
        if stat.S_ISLNK(state.st_mode):
            links += 1
            if links > _MOST_LINKS:
                return f"{place} is a link without an end"
            left = [*Path(os.readlink(place)).parts, *left]
            place = place.parent
        elif state.st_mode & stat.S_IWOTH and not state.st_mode & stat.S_ISVTX:
            return f"{place} can be written by everybody"
        if not left:
            return None
        place = Path(os.path.normpath(place / left[0])) if left[0] == ".." else place / left[0]
        left = left[1:]
