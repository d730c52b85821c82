"""`firmloop verify`: generate, build and run the C against the bit-exact reference."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop import arguments as ask
from firmloop.console import Console, progress, table

if TYPE_CHECKING:
    from firmloop.codegen.bundle import Bundle
    from firmloop.stages.baseline import Growth

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
    ask.fmu(parser, "closes the loop in the place of the equations of [plant], or without one")
    parser.add_argument("--junit", type=ask.place, metavar="FILE", help="a JUnit report for continuous integration")
    parser.add_argument(
        "--sarif", type=ask.place, metavar="FILE", help="a SARIF report, with what static checks find in the C"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave the C, DIR/verdict.json and the reports that were asked for."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.load import load
    from firmloop.door.verify import verify
    from firmloop.identify.extras import ToolError
    from firmloop.output import VERDICTS, results_folder, save_report, written
    from firmloop.presentation.junit import junit
    from firmloop.presentation.sarif import sarif
    from firmloop.project.project import campaign_targets, require
    from firmloop.stages.baseline import check_baseline, growths
    from firmloop.stages.verification import Outcome
    from firmloop.told import tell_end, tell_noun
    from firmloop.verify.build.static_checks import read_statically

    project, baseline = load(arguments.project), arguments.baseline
    require(project, "controller", "signals", "arithmetic")
    targets = campaign_targets(project, arguments.target or ())
    if baseline is not None:
        check_baseline(baseline, targets)

    def report(bundle: Bundle | None, outcomes: Sequence[Outcome], found: Sequence[Growth]) -> None:
        if arguments.junit is not None:
            save_report(junit(project.name, outcomes, found), arguments.junit, "--junit")
        if arguments.sarif is not None:
            with progress("reading the C with static checks"):
                readings = read_statically(bundle) if bundle is not None else ()
            text = sarif(arguments.out / project.name / "src", bundle, outcomes, readings)
            save_report(text, arguments.sarif, "--sarif")

    with results_folder(arguments.out, VERDICTS) as folder:
        asked = {"steps": arguments.steps, "seed": arguments.seed, "port": arguments.port}
        plant = {"fmu": arguments.fmu, "wires": dict(arguments.wire)}
        try:
            made = verify(
                project, targets=targets, **asked, **plant, stage=progress, tell=lambda noun: tell_noun(console, noun)
            )
        except ToolError as error:
            report(None, [Outcome(target, None, str(error)) for target in targets], ())
            raise
        found: Sequence[Growth] = ()
        if baseline is not None:
            found = growths(baseline, arguments.growth, made.outcomes)
            console.lines([f"against {baseline}:", *table([(growth.figure, growth.says()) for growth in found])])
            console.result("baseline", {growth.figure: [growth.before, growth.now] for growth in found})
        files = made.files()
        write_files(files, folder)
    report(made.code.generated.bundle, made.outcomes, found)
    written(console, arguments.out, files)
    return tell_end(console, made.outcomes, made.not_tracked) or int(any(growth.too_much for growth in found))


def _percent(text: str) -> float:
    return ask.number(text, 0.0, 1000.0)
