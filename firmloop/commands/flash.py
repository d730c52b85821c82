"""`firmloop flash`: build the image of a board and put it there."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "flash"
HELP = "build the image of a board and put it there; DIR/image.elf"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the folder of the results, the board, and what is to run on it."""
    ask.project_and_place(parser, "DIR")
    parser.add_argument("--target", required=True, metavar="NAME", help="the board, as `firmloop targets` calls it")
    parser.add_argument("--live", type=Path, metavar="FILE.c", help="run by itself on the two functions of this file")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/image.elf and the file to drag, and flash the board if pyOCD or OpenOCD is here."""
    from firmloop.output import results_folder
    from firmloop.project.project import campaign_targets, read_project
    from firmloop.stages.board.flashing import board_of, build, put_there

    project = read_project(arguments.project)
    target = board_of(project, campaign_targets(project, (arguments.target,))[0])
    with results_folder(arguments.out, ()) as folder, progress(f"building for {target.name}"):
        built = build(project, target, arguments.live, folder)
    size = built.size
    console.lines(
        [f"{target.name}: {size.text_bytes} bytes of flash, {size.data_bytes + size.bss_bytes} of RAM, stack included"]
    )
    console.result("program_id", built.program_id)
    console.result("files", [str(arguments.out / name) for name in built.files])
    with progress(f"flashing {target.name}"):
        tool = put_there(target, built, arguments.out)
    console.result("flashed_by", tool)
    if tool is not None:
        words = map(quote, (str(arguments.project), "--target", arguments.target))
        console.lines([f"flashed with {tool}; then: firmloop verify {' '.join(words)} --port ..."])
    else:
        dragged = arguments.out / built.files[-1]
        console.lines([f"NOT flashed: drag {dragged} onto the board's drive; or: pip install pyocd"])
    return 0
