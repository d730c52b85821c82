"""`firmloop simulate`: predict every output of a recording."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "simulate"
HELP = "predict every output of a recording from its input column alone"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the file of the prediction, the recording, and where to start."""
    ask.project_and_place(parser, "FILE.csv")
    parser.add_argument("recording", type=Path, metavar="RECORDING", help="the recording whose input is taken")
    parser.add_argument("--fit-initial", action="store_true", help="fit the initial state instead of starting at rest")
    ask.fmu(parser, "predicts in the place of the equations of [plant], or without one")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave FILE.csv with the recording's columns and rows."""
    from firmloop.door.load import load
    from firmloop.door.simulate import as_recorded, at_rest, simulate
    from firmloop.output import written
    from firmloop.project.table import ProjectError

    project, out = load(arguments.project), arguments.out
    if os.path.realpath(out) == os.path.realpath(arguments.recording):
        raise ProjectError(f"--out {out}: is the recording itself; choose another file")
    start = as_recorded if arguments.fit_initial else at_rest
    plant = {"fmu": arguments.fmu, "wires": dict(arguments.wire)}
    made = simulate(project, arguments.recording, start=start, **plant, stage=progress)
    made.save(out)
    console.lines([f"note: {note}" for note in (*made.measured.notes, *made.predicted.notes)])
    written(console, out.parent, [out.name])
    return 0
