"""`firmloop init`: write a project from recordings alone."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "init"
HELP = "guess columns, units, plant and ranges of recordings, and write a commented project that runs"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the recordings, and for what they may not tell."""
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help="files; the last is only scored")
    parser.add_argument(
        "--out", type=ask.place, metavar="FILE.toml", help="the project (default: beside the first recording)"
    )
    parser.add_argument("--period", type=_period, metavar="SECONDS", help="between two rows, of files without a time")
    parser.add_argument(
        "--leave-out", action="append", default=[], metavar="COLUMN", help="a column that is not used; may be repeated"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave FILE.toml; one that is there is never touched."""
    from firmloop.output import new_file
    from firmloop.presentation.first_words import about_first
    from firmloop.project.first_text import first_text
    from firmloop.project.table import ProjectError
    from firmloop.stages.starting.guess import guess_project

    files = tuple(dict.fromkeys(arguments.recordings))
    for folder in filter(Path.is_dir, files):
        raise ProjectError(
            f"{folder}: is a folder; name the recordings in it: firmloop init {quote(str(folder / 'a.csv'))}"
        )
    stem = files[0].name.split(".")[0]
    out = arguments.out or files[0].with_name(f"{stem}.toml")
    for path in (*files, out):
        if not str(path).isprintable():
            raise ProjectError(f"{str(path)!a}: a project cannot name this file; give it a name of plain signs")
    if out.suffix != ".toml":
        raise ProjectError(f"--out {out}: a project is a file that ends in .toml")
    with new_file(out) as write:
        with progress("guessing a project") as report:
            first = guess_project(files, out.stem, arguments.period, arguments.leave_out, report)
        write(first_text(first, out.absolute().parent))
    words = quote(str(out)), "--out", quote(f"{out.with_suffix('')}_out")
    console.lines([*about_first(first), f"written: {out}", f"next: firmloop run {' '.join(words)}"])
    console.result("written", [str(out)])
    return 0


def _period(text: str) -> float:
    return ask.number(text, 1e-9, 86400.0)
