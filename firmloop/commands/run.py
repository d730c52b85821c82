"""`firmloop run`: the whole walk."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from firmloop import arguments as ask
from firmloop.console import Console, progress

if TYPE_CHECKING:
    from firmloop.door.evidence import Evidenced

NAME = "run"
HELP = "the whole walk: identify, design, generate, verify, report"

DIFFERS = 1


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the folder of the results, where to verify, and where to file the evidence."""
    ask.project_and_place(parser, "DIR")
    ask.campaign(parser)
    ask.fmu(parser, "closes the loop in the place of the fitted plant")
    parser.add_argument(
        "--evidence",
        type=ask.place,
        metavar="DIR",
        help="file requirements, claims, judges and results there; if they differ from those filed, status 1",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave the fitted project, the C, the verdicts, DIR/report.html, and the evidence that was asked for."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.evidence import evidence
    from firmloop.door.load import load
    from firmloop.door.run import run as walk
    from firmloop.output import VERDICTS, results_folder, save_over, written
    from firmloop.project.project import campaign_targets, require
    from firmloop.stages.evidence.evidence import filed
    from firmloop.told import tell_end, tell_noun

    project, place = load(arguments.project), arguments.evidence
    require(project, "recordings", "plant", "controller", "signals", "arithmetic")
    targets = campaign_targets(project, arguments.target or ())
    before = None if place is None else filed(place)
    with results_folder(arguments.out, VERDICTS) as folder:
        asked = {"steps": arguments.steps, "seed": arguments.seed, "port": arguments.port}
        plant = {"fmu": arguments.fmu, "wires": dict(arguments.wire)}
        made = walk(
            project, targets=targets, **asked, **plant, stage=progress, tell=lambda noun: tell_noun(console, noun)
        )
        with progress("writing the report"):
            files = made.files(arguments.out)
        write_files(files, folder)
    status = tell_end(console, made.verified.outcomes, made.verified.not_tracked)
    if place is not None:
        found = evidence(made, before, stage=progress)
        save_over(found.files(), place, ("evidence_new.*",))
        _tell_evidence(console, found, before is not None)
        written(console, place, found.files())
        status = status or (DIFFERS if found.differences else status)
    written(console, arguments.out, files)
    return status


def _tell_evidence(console: Console, found: Evidenced, again: bool) -> None:
    from firmloop.presentation.evidence.page import about_evidence

    console.lines(about_evidence(found.evidence))
    if found.differences:
        console.lines(["it differs from what is filed there, which is kept:", *(f"  {d}" for d in found.differences)])
        console.lines(["to file the new evidence, move evidence_new.json and evidence_new.html over the old"])
    elif again:
        console.lines(["it is what was filed there before"])
    console.result("evidence", found.evidence.as_dict())
    console.result("evidence_differences", list(found.differences))
