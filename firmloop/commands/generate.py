"""`firmloop generate`: write the controller's C."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "generate"
HELP = "write the controller's C as a folder to copy, DIR/NAME, and DIR/manifest.json"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave the C, its manifest and its proof in DIR."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.generate import generate
    from firmloop.door.load import load
    from firmloop.output import results_folder, written
    from firmloop.told import tell_noun

    project = load(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        made = generate(project, stage=progress)
        tell_noun(console, made)
        write_files(made.files, folder)
    written(console, arguments.out, made.files)
    return 0
