"""`firmloop tune`: every tuning rule on one plant, in one table."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "tune"
HELP = "tune the controller by every rule and compare the loops; DIR/tuning.csv"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/tuning.json and DIR/tuning.csv with the table."""
    from firmloop.codegen.bundle import write_files
    from firmloop.design.tuning import rules
    from firmloop.output import results_folder, written
    from firmloop.presentation.documents import result_json
    from firmloop.presentation.tuning_table import about_contest, contest_csv, contest_document, contest_notes
    from firmloop.presentation.words import about_reach
    from firmloop.project.project import read_project, require
    from firmloop.stages.plant import plant_of
    from firmloop.stages.tuning import compare, out_of_reach

    project = read_project(arguments.project)
    require(project, "plant", "controller", "signals")
    with results_folder(arguments.out, ()) as folder:
        with progress("tuning by every rule"):
            plant = plant_of(project)
            entries, reach = compare(project, plant, tuple(rules())), about_reach(out_of_reach(project, plant))
        notes = [note.strip().removeprefix("note: ") for note in (*contest_notes(entries), *reach)]
        document = {"rules": contest_document(entries), "notes": notes}
        files = {"tuning.json": result_json(document), "tuning.csv": contest_csv(entries)}
        write_files(files, folder)
    console.lines([*about_contest(entries), *reach])
    console.result("tuning", document["rules"])
    written(console, arguments.out, files)
    return 0
