"""`firmloop datasheet`: parameters of a motor from its datasheet and the standard tests."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console

NAME = "datasheet"
HELP = "parameters from a datasheet and the standard tests, checked; DIR/project.toml"

AGREES, CONTRADICTS = 0, 1


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/project.toml with the plant, DIR/datasheet.json with everything else."""
    from firmloop.codegen.bundle import write_files
    from firmloop.output import results_folder, written
    from firmloop.presentation.datasheet_words import about_datasheet, datasheet_document
    from firmloop.presentation.documents import result_json
    from firmloop.project.project import read_project
    from firmloop.project.project_text import made_text
    from firmloop.stages.bench.datasheet import datasheet

    project = read_project(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        made = datasheet(project)
        document = datasheet_document(made.sheet, made.reading, made.found, made.forms, made.told)
        files = {"datasheet.json": result_json(document)}
        if not made.missing:
            files["project.toml"] = made_text(project, made.plant, NAME, arguments.out)
        write_files(files, folder)
    console.lines(about_datasheet(made.sheet, made.reading, made.found, made.forms, made.told, made.missing))
    for key, value in document.items():
        console.result(key, value)
    written(console, arguments.out, files)
    return CONTRADICTS if made.told else AGREES
