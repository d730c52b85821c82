"""`firmloop step`: step responses over repeated trials."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console

NAME = "step"
HELP = "measure step responses over repeated trials, and read models off them; DIR/step.json"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/step.json with all figures."""
    from firmloop.codegen.bundle import write_files
    from firmloop.output import results_folder, written
    from firmloop.presentation.documents import result_json
    from firmloop.presentation.step_words import about_steps, steps_document
    from firmloop.project.project import read_project
    from firmloop.stages.bench.step_tests import measure_steps

    project = read_project(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        found = measure_steps(project)
        document = steps_document(found.responses, found.figures, found.read, found.halves)
        files = {"step.json": result_json(document)}
        write_files(files, folder)
    console.lines(about_steps(found.responses, found.figures, found.read, found.halves))
    console.lines([f"  note: {note}" for note in found.notes])
    console.result("step", document)
    written(console, arguments.out, files)
    return 0
