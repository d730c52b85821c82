"""`firmloop design`: tune the controller."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "design"
HELP = "tune the controller; margins and step metrics"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/design.json with gains, margins and step metrics, DIR/project.toml with the gains."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.design import design
    from firmloop.door.load import load
    from firmloop.output import results_folder, written
    from firmloop.presentation.telling import tell_design
    from firmloop.presentation.tuning_table import about_contest

    project = load(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        made = design(project, stage=progress)
        tell_design(console, made.design, made.loop)
        console.lines(about_contest(made.tuned) if made.tuned else [])
        files = made.files(arguments.out)
        write_files(files, folder)
    written(console, arguments.out, files)
    return 0
