"""The `diagnose` verb: where simulation and recordings differ and why; its files and its exit status."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from firmloop.codegen.bundle import write_files
from firmloop.console import Console, progress
from firmloop.diagnose.cut import Cut, cut
from firmloop.diagnose.doubt import with_doubt
from firmloop.diagnose.halves import with_controller
from firmloop.diagnose.prepare import as_conditioned
from firmloop.diagnose.run import Diagnosis, diagnose
from firmloop.output import results_folder
from firmloop.presentation.diagnosis_report import diagnosis_report
from firmloop.project.project import Project, require
from firmloop.project.project_text import diagnosed_text
from firmloop.stages.pipeline import (
    Data,
    Report,
    command_of,
    conditioning_of,
    controller_of,
    identify,
    located,
    plant_of,
    read_data,
)

NOTHING, FOUND = 0, 1
FILES = ("diagnosis.json", "project.toml", "report.html")


def diagnosed(project: Project, data: Data, report: Report) -> Diagnosis:
    """Diagnose the project on its recordings."""
    return both_halves(project, data, report)[0]


def both_halves(project: Project, data: Data, report: Report) -> tuple[Diagnosis, Cut | None]:
    """Diagnose the project's plant on its recordings, and replay its controller where they hold what it was given.

    A plant without values is identified first.
    """
    with located(project):
        plant = plant_of(project)
        if any(math.isnan(parameter.value) for parameter in plant.parameters):
            plant = identify(project, data, report).plant
        conditioning = conditioning_of(project)
        (train, notes), (test, _) = (as_conditioned(plant, part, conditioning) for part in (data.train, data.test))
        with threadpool_limits(1):  # thousands of small products: threads would only wait for each other
            made = diagnose(plant, train, test, report)
        controller = controller_of(project)
        replayed = None if controller is None else cut(plant, controller, (*data.train, *data.test))
        said = (*made.finding.says, *(f"Note: {note}." for note in notes))
        finding = replace(made.finding, notes=(*made.finding.notes, *notes), says=said)
        return replace(made, finding=with_controller(with_doubt(finding), replayed)), replayed


def diagnose_project(project: Project, out: Path, console: Console) -> int:
    """Diagnose; OUT holds diagnosis.json, an improved project.toml and report.html."""
    require(project, "plant", "recordings")
    with results_folder(out, ()) as folder:
        data = read_data(project)
        with progress("diagnosing") as bar:
            made, replayed = both_halves(project, data, bar)
            bar(0.95, "writing the report")
            document = made.finding.as_dict()
            files = {
                "diagnosis.json": json.dumps(document, indent=1, allow_nan=False) + "\n",
                "project.toml": diagnosed_text(project, made.plant, made.hold, out),
                "report.html": diagnosis_report(project.name, command_of("diagnose", project.path), made, replayed),
            }
        write_files(files, folder)
    console.lines([f"verdict: {made.finding.verdict}", *made.finding.says])
    console.lines([f"written to {out}: {', '.join(FILES)}"])
    for key, value in document.items():
        console.result(key, value)
    return NOTHING if made.finding.verdict == "no_mismatch" else FOUND
