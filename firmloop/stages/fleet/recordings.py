"""Find the recordings of a fleet, and which machine each is of."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.identify.recordings.formats import find_format, known_endings
from firmloop.project.table import ProjectError


@dataclass(frozen=True, slots=True)
class FleetRecording:
    """One file: its machine, its name within the fleet (with folders, by slashes), and where it is."""

    machine: str
    name: str
    path: Path


def find_fleet(where: str, out: Path) -> tuple[FleetRecording, ...]:
    """Return the recordings of a folder, or those that a pattern matches, machine by machine, the oldest first.

    A file directly in the folder is a machine of its own; the files in a folder within it, by their names, are the
    recordings of one machine in order of time. Numbers in names count as numbers: run_9 comes before run_10. What lies
    in `out`, where results go, and what is hidden, is left alone.

    Raises
    ------
    ProjectError
        when there is no recording.
    """
    root, paths = _matched(where)
    kept = os.path.realpath(out)
    found = []
    for path in paths:
        name = path.relative_to(root).as_posix()
        hidden = any(part.startswith(".") for part in Path(name).parts)
        if hidden or not find_format(path.name) or not os.path.isfile(path) or _within(path, kept):
            continue
        machine, slash, _ = name.partition("/")
        found.append(FleetRecording(machine if slash else _stem(path.name), name, path))
    if not found:
        raise ProjectError(
            f"--fleet {where}: there is no recording; name a folder of files that end in "
            f"{', '.join(known_endings())}, or a pattern such as 'bench/*/*.csv'"
        )
    found.sort(key=lambda one: (_natural(one.machine), _natural(one.name)))
    _no_twins(where, found)
    return tuple(found)


def _matched(where: str) -> tuple[Path, list[Path]]:
    """Return the folder that names begin at, and every path below it that is meant."""
    place = Path(where)
    if place.is_dir():
        return place, list(_files(place))
    fixed = [part for part in place.parts[:-1]]
    first = next((k for k, part in enumerate(fixed) if glob.has_magic(part)), len(fixed))
    root = Path(*fixed[:first]) if first else Path()
    return root, [Path(path) for path in glob.glob(where, recursive=True)]


def _files(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder):
        folders.sort()
        yield from (Path(parent) / name for name in sorted(names))


def _within(path: Path, folder: str) -> bool:
    return os.path.realpath(path).startswith(f"{folder}{os.sep}")


def _stem(name: str) -> str:
    """Return a file's name without the ending of its format, which may have two parts."""
    lowered = name.lower()
    ending = max((each for each in known_endings() if lowered.endswith(each)), key=len)
    return name[: -len(ending)] or name


def _natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return what sorts names by the numbers in them; isdecimal() takes digits of other scripts too, as int() does."""
    parts = [part for part in re.split(r"(\d+)", name) if part]
    ranks = ((0, int(part), "") if part.isdecimal() else (1, 0, part.lower()) for part in parts)
    return (*ranks, (1, 0, name))


def _no_twins(where: str, found: Sequence[FleetRecording]) -> None:
    """Refuse two files of one name that differ in their endings alone: they would be one machine by accident."""
    alone = [one for one in found if "/" not in one.name]
    machines = {one.machine for one in found if "/" in one.name}
    for k, one in enumerate(alone):
        if one.machine in machines or (k and alone[k - 1].machine == one.machine):
            raise ProjectError(
                f"--fleet {where}: {one.name} is of machine {one.machine}, and so is another file or folder there; "
                f"put all recordings of one machine into a folder {one.machine}"
            )
