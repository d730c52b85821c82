"""`firmloop diagnose`: where simulation and recordings differ, and why."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "diagnose"
HELP = "say where simulation and recordings differ and why; DIR/diagnosis.json, DIR/report.html"

NOTHING, FOUND = 0, 1


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/diagnosis.json, an improved DIR/project.toml and DIR/report.html."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.diagnose import diagnose
    from firmloop.door.load import load
    from firmloop.output import results_folder

    project, out = load(arguments.project), arguments.out
    with results_folder(out, ()) as folder:
        made = diagnose(project, stage=progress)
        with progress("writing the report"):
            files = made.files(out)
        write_files(files, folder)
    console.lines([f"verdict: {made.finding.verdict}", *made.finding.says])
    console.lines([f"written to {out}: {', '.join(files)}"])
    for key, value in made.finding.as_dict().items():
        console.result(key, value)
    return NOTHING if made.finding.verdict == "no_mismatch" else FOUND
