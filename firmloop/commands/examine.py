"""`firmloop examine`: how far a fit can be trusted, by more than one way."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "examine"
HELP = "intervals by three ways, residual tests, sensitivities; DIR/examination.json"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the folder of the results, and how often to draw."""
    ask.project_and_place(parser, "DIR")
    parser.add_argument(
        "--draws", type=_draws, default=10_000, metavar="N", help="draws of the Monte Carlo intervals (default 10000)"
    )
    parser.add_argument(
        "--seed", type=ask.seed, default=ask.SEED, metavar="N", help=f"seed of the draws (default {ask.SEED})"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/examination.json, and DIR/project.toml with the fit."""
    from firmloop.codegen.bundle import write_files
    from firmloop.output import results_folder, written
    from firmloop.presentation.documents import result_json
    from firmloop.presentation.examination_words import about_examination, examination_document
    from firmloop.presentation.words import about_fit
    from firmloop.project.project import read_project, require
    from firmloop.project.project_text import fitted_text
    from firmloop.stages.bench.examination import examination
    from firmloop.stages.data import read_data
    from firmloop.stages.saturation import refuse_saturated

    project = read_project(arguments.project)
    require(project, "plant", "recordings")
    data = read_data(project)
    refuse_saturated(project, data.train)
    with results_folder(arguments.out, ()) as folder:
        with progress("examining the fit") as report:
            found = examination(project, data, arguments.draws, arguments.seed, report)
        document = examination_document(found)
        files = {
            "examination.json": result_json(document),
            "project.toml": fitted_text(project, found.fit.plant, arguments.out),
        }
        write_files(files, folder)
    console.lines(about_fit(found.fit))
    console.lines(about_examination(found))
    console.lines([f"  note: {note}" for note in data.notes])
    for key, value in document.items():
        console.result(key, value)
    written(console, arguments.out, files)
    return 0


def _draws(text: str) -> int:
    return ask.whole(text, 100, 1_000_000)
