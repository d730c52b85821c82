"""`firmloop model`: a linear model from data alone."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "model"
HELP = "fit ARX, OE or a subspace model where no physics is known; DIR/project.toml"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/project.toml with the model as an ode, DIR/model.json with all figures."""
    from firmloop.codegen.bundle import write_files
    from firmloop.output import results_folder, written
    from firmloop.presentation.documents import result_json
    from firmloop.presentation.model_words import about_model, model_document
    from firmloop.project.project import read_project
    from firmloop.project.project_text import made_text
    from firmloop.stages.bench.black_box import black_box

    project = read_project(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        found = black_box(project, progress)
        document = model_document(found)
        files = {
            "model.json": result_json(document),
            "project.toml": made_text(project, found.plant, NAME, arguments.out),
        }
        write_files(files, folder)
    console.lines(about_model(found))
    console.result("model", document)
    written(console, arguments.out, files)
    return 0
