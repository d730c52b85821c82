"""`firmloop export`: the controller, or the plant with its effects, for other simulators."""

from __future__ import annotations

import argparse
from pathlib import Path

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "export"
HELP = "write the controller, or the plant with its effects, as a source FMU (FMI 3, co-simulation)"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the form and the file."""
    parser.add_argument("project", type=Path, metavar="PROJECT", help="the project's TOML file")
    parser.add_argument("--fmu", action="store_true", required=True, help="a Functional Mock-up Unit with its sources")
    parser.add_argument(
        "--of", choices=("controller", "plant"), default="controller", help="which of them (default: the controller)"
    )
    parser.add_argument(
        "--step", type=_step, metavar="SECONDS", help="how often the plant takes its inputs (default: the controller's)"
    )
    parser.add_argument("--out", type=ask.place, required=True, metavar="FILE.fmu", help="the file")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave FILE.fmu."""
    from firmloop.codegen.fmu import fmu_files
    from firmloop.door.generate import generate_for
    from firmloop.door.load import load
    from firmloop.output import save_archive
    from firmloop.stages.exporting import export_plant
    from firmloop.stages.plant import command_of, located

    project, out = load(arguments.project), arguments.out
    if arguments.of == "plant":
        exported = export_plant(project, arguments.step)
        files, said = exported.files, f"{project.name}_plant, inputs every {exported.period:g} s"
    else:
        made = generate_for("export", project, progress).generated
        with located(project):
            files = fmu_files(made.program, made.bundle, command_of("export", project.path))
        said = f"{made.program.name}, a step every {made.program.period:g} s"
    save_archive(files, out, (".fmu",))
    console.lines([f"FMU: {said}", f"written: {out}"])
    console.result("written", [str(out)])
    return 0


def _step(text: str) -> float:
    return ask.number(text, 1e-9, 86400.0)
