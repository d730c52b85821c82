"""`firmloop identify`: fit the plant to the train recordings."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "identify"
HELP = "fit the plant to the train recordings; DIR/project.toml holds it"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/project.toml with the fitted plant."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.identify import identify
    from firmloop.door.load import load
    from firmloop.output import results_folder, written
    from firmloop.presentation.telling import tell_fit

    project = load(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        made = identify(project, stage=progress)
        tell_fit(console, made.fit)
        files = made.files(arguments.out)
        write_files(files, folder)
    written(console, arguments.out, files)
    return 0
