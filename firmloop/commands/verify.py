"""`firmloop verify`: generate, build and run the C against the bit-exact reference."""

from __future__ import annotations

import argparse
from pathlib import Path

from firmloop import arguments as ask
from firmloop.console import Console, progress, table

NAME = "verify"
HELP = "generate, build and run the C against the bit-exact reference; DIR/verdict.json"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the folder of the results, where to verify, and an older run to compare costs with."""
    ask.project_and_place(parser, "DIR")
    ask.campaign(parser)
    parser.add_argument(
        "--baseline", type=Path, metavar="FILE", help="an older cost.json; status 1 if a cost has grown"
    )
    parser.add_argument(
        "--growth", type=_percent, default=2.0, metavar="PERCENT", help="that a cost may grow by (default 2)"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave the C and DIR/verdict.json."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.load import load
    from firmloop.door.verify import verify
    from firmloop.output import VERDICTS, results_folder, written
    from firmloop.project.project import campaign_targets, require
    from firmloop.stages.baseline import check_baseline, growths
    from firmloop.told import tell_end, tell_noun

    project, baseline = load(arguments.project), arguments.baseline
    require(project, "controller", "signals", "arithmetic")
    targets = campaign_targets(project, arguments.target or ())
    if baseline is not None:
        check_baseline(baseline, targets)
    with results_folder(arguments.out, VERDICTS) as folder:
        asked = {"steps": arguments.steps, "seed": arguments.seed, "port": arguments.port}
        made = verify(project, targets=targets, **asked, stage=progress, tell=lambda noun: tell_noun(console, noun))
        grown = False
        if baseline is not None:
            found = growths(baseline, arguments.growth, made.outcomes)
            console.lines([f"against {baseline}:", *table([(growth.figure, growth.says()) for growth in found])])
            console.result("baseline", {growth.figure: [growth.before, growth.now] for growth in found})
            grown = any(growth.too_much for growth in found)
        files = made.files()
        write_files(files, folder)
    written(console, arguments.out, files)
    return tell_end(console, made.outcomes, made.not_tracked) or int(grown)


def _percent(text: str) -> float:
    return ask.number(text, 0.0, 1000.0)
