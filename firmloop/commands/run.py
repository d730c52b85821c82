"""`firmloop run`: the whole walk."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "run"
HELP = "the whole walk: identify, design, generate, verify, report"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the folder of the results, and where to verify."""
    ask.project_and_place(parser, "DIR")
    ask.campaign(parser)


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave the fitted project, the C, the verdicts and DIR/report.html."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.load import load
    from firmloop.door.run import run as walk
    from firmloop.output import VERDICTS, results_folder, written
    from firmloop.project.project import campaign_targets, require
    from firmloop.told import tell_end, tell_noun

    project = load(arguments.project)
    require(project, "recordings", "plant", "controller", "signals", "arithmetic")
    targets = campaign_targets(project, arguments.target or ())
    with results_folder(arguments.out, VERDICTS) as folder:
        asked = {"steps": arguments.steps, "seed": arguments.seed, "port": arguments.port}
        made = walk(project, targets=targets, **asked, stage=progress, tell=lambda noun: tell_noun(console, noun))
        with progress("writing the report"):
            files = made.files(arguments.out)
        write_files(files, folder)
    written(console, arguments.out, files)
    return tell_end(console, made.verified.outcomes, made.verified.not_tracked)
