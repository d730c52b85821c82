"""Put results in place only when all of them are there."""

from __future__ import annotations

import errno
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.console import Console
from firmloop.identify.simulation.scratch import Scratch, make_scratch, sweep
from firmloop.project.table import ProjectError

VERDICTS = ("verdict.json", "verdict_*.json", "search_*.svg", "cost.json")  # of an older run, none may stay
_NO_DATE = (1980, 1, 1, 0, 0, 0)  # the first that the format knows
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # writing fails with these without saying where


@contextmanager
def results_folder(folder: Path, stale: Sequence[str], option: str = "--out") -> Iterator[Path]:
    """Give a temporary folder; its files move into `folder`, each atomically, if nothing is raised.

    A folder that is there is used again: files of the same name are replaced, those that match a pattern of `stale` and
    were not made again are removed, others are left alone. After an error nothing has changed, and folders made on the
    way are gone. `option` is the one that `folder` was given by.

    Raises
    ------
    ProjectError
        when `folder` is a file or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise ProjectError(f"{option} {folder}: is a file; name a folder")
    place, shown = Path(os.path.abspath(folder)), f"{option} {folder}"
    with _beside(place, shown) as partial:
        yield partial
        _move(partial, place, shown, stale)


@contextmanager
def results_file(file: Path, endings: tuple[str, ...] = (".csv", ".csv.gz")) -> Iterator[Path]:
    """Give a temporary path for `file`, which takes its place if nothing is raised.

    Raises
    ------
    ProjectError
        when `file` is a folder, does not end as it has to, or cannot be written.
    """
    if not file.name.endswith(endings):
        raise ProjectError(f"--out {file}: must be a file that ends in {' or '.join(endings)}")
    if what := _in_the_way(file):
        raise ProjectError(f"--out {file}: is {what}; name a file")
    place = Path(os.path.abspath(file))
    with _beside(place, f"--out {file}") as partial:
        yield partial / file.name
        _settle(partial / file.name)
        os.replace(partial / file.name, place)


@contextmanager
def _beside(place: Path, shown: str) -> Iterator[Path]:
    """Give a temporary folder inside `place`, else beside it (the same disk); take away what is not needed."""
    home = place if place.is_dir() else place.parent
    made: list[Path] = []
    scratch: Scratch | None = None
    try:
        made = _make_folders(home)
        sweep(place.parent, f".{place.name}")
        scratch = make_scratch(home, f".{place.name}", 0o777)  # what becomes of it follows the user's umask
        yield scratch.path
        made = []
    except OSError as error:
        where = str(error.filename or "")
        if error.errno not in FULL and not where.startswith(str(home)):
            raise
        raise ProjectError(f"{shown}: cannot be written: {error.strerror}; choose another place") from None
    finally:
        if scratch:
            scratch.remove()
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()


def _make_folders(folder: Path) -> list[Path]:
    """Make a folder and its parents; return those that were not there, innermost first."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _move(partial: Path, place: Path, shown: str, stale: Sequence[str]) -> None:
    """Move every file to its place, each on the disk before; nothing moves where a folder or link stands in the way.

    Documents speak of the other files: the old ones go before any file changes, and the new ones come last. However
    this ends, no verdict stands beside files that it is not about.
    """
    files = [path.relative_to(partial) for path in sorted(partial.rglob("*")) if path.is_file()]
    for relative in files:
        if what := _in_the_way(place / relative):
            raise ProjectError(f"{shown}: {relative} is {what} there; move it away or choose another folder")
        for parent in relative.parents:
            if parent.name and (place / parent).is_symlink():  # it would lead the files out of the folder
                raise ProjectError(f"{shown}: {parent} is a link there; move it away or choose another folder")
        _settle(partial / relative)
    if not place.exists():
        partial.rename(place)
        return
    for old in {found for pattern in stale for found in place.glob(pattern)}:
        old.unlink()
    documents = [relative for relative in files if relative.suffix == ".json"]
    for relative in documents:
        (place / relative).unlink(missing_ok=True)
    for relative in [*(relative for relative in files if relative not in documents), *documents]:
        (place / relative).parent.mkdir(parents=True, exist_ok=True)
        os.replace(partial / relative, place / relative)


def _in_the_way(place: Path) -> str:
    """Say what stands where a file is to be: one of ours would take the place of a device of the machine, too."""
    return "a folder" if place.is_dir() else "a pipe or a device" if place.exists() and not place.is_file() else ""


def _settle(file: Path) -> None:
    """Wait until the disk has a file, so that its new name is never that of an empty one after a power cut."""
    with file.open("rb") as stream:
        os.fsync(stream.fileno())


def written(console: Console, folder: Path, names: Sequence[str] | Mapping[str, str]) -> None:
    """Tell where the results are; in words, those that a person opens, and a folder of files as a whole."""
    opened = (".html", ".toml", ".csv", ".gz", ".svg")
    shown = dict.fromkeys(name.partition("/")[0] for name in names if "/" in name or name.endswith(opened))
    console.lines([f"written: {folder / name}" for name in shown])
    console.result("written", [str(folder / name) for name in names])


def save(files: Mapping[str, str], folder: Path) -> None:
    """Write files by their name into `folder`, all or none; others that are there stay."""
    save_over(files, folder, ())


def save_report(text: str, file: Path, option: str) -> None:
    """Write a report beside other files, at the place that `option` has named."""
    with results_folder(file.parent, (), option) as partial:
        write_files({file.name: text}, partial)


def save_over(files: Mapping[str, str], folder: Path, stale: Sequence[str]) -> None:
    """Write files by their name into `folder`, all or none; what matches `stale` and is not among them goes."""
    with results_folder(folder, stale) as partial:
        write_files(files, partial)


@contextmanager
def new_file(file: Path) -> Iterator[Callable[[str], None]]:
    """Give a function that writes the text of `file`, which must not be there yet; nothing is left after an error.

    Raises
    ------
    ProjectError
        when something of that name is there, or it cannot be written.
    """
    taken = f"--out {file}: is there already and is not overwritten; name another file: --out FILE.toml"
    if file.exists() or file.is_symlink():
        raise ProjectError(taken)

    def write(text: str) -> None:
        place = Path(os.path.abspath(file))
        with _beside(place, f"--out {file}"):
            try:
                stream = place.open("x", encoding="utf-8", newline="\n")  # unlike a rename, it replaces nothing
            except FileExistsError:
                raise ProjectError(taken) from None
            with stream:
                stream.write(text)
            _settle(place)

    yield write


def save_archive(files: Mapping[str, str], file: Path, endings: tuple[str, ...]) -> None:
    """Write files into one archive; the same files give the same bytes.

    Raises
    ------
    ProjectError
        as `results_file` does.
    """
    with results_file(file, endings) as place, zipfile.ZipFile(place, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(zipfile.ZipInfo(name, _NO_DATE), text, zipfile.ZIP_DEFLATED)
