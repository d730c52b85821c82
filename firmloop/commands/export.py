"""`firmloop export`: the controller for other simulators."""

from __future__ import annotations

import argparse
from pathlib import Path

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "export"
HELP = "write the controller as a source FMU (FMI 3, co-simulation)"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the form and the file."""
    parser.add_argument("project", type=Path, metavar="PROJECT", help="the project's TOML file")
    parser.add_argument("--fmu", action="store_true", required=True, help="a Functional Mock-up Unit with its sources")
    parser.add_argument("--out", type=ask.place, required=True, metavar="FILE.fmu", help="the file")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave FILE.fmu."""
    from firmloop.codegen.fmu import fmu_files
    from firmloop.door.generate import generate_for
    from firmloop.door.load import load
    from firmloop.output import save_archive
    from firmloop.stages.plant import command_of, located

    project, out = load(arguments.project), arguments.out
    made = generate_for("export", project, progress).generated
    with located(project):
        files = fmu_files(made.program, made.bundle, command_of("export", project.path))
    save_archive(files, out, (".fmu",))
    console.lines([f"FMU: {made.program.name}, a step every {made.program.period:g} s", f"written: {out}"])
    console.result("written", [str(out)])
    return 0
