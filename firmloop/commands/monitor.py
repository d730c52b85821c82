"""`firmloop monitor`: watch a controller that runs by itself."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from firmloop import arguments as ask
from firmloop.console import Console, Progress, progress

if TYPE_CHECKING:
    from firmloop.stages.board.channels import Channel
    from firmloop.stages.board.tape import Tape

NAME = "monitor"
HELP = "watch a controller that runs by itself; FILE.csv is a recording"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the file of the recording, the controller, and what to watch and set."""
    ask.project_and_place(parser, "FILE.csv")
    ask.watched(parser)
    parser.add_argument("--seconds", type=ask.seconds, default=10.0, metavar="S", help="how long (default 10)")
    parser.add_argument(
        "--set",
        dest="settings",
        type=ask.setting,
        action="append",
        default=[],
        metavar="NAME=VALUE[@S]",
        help="set a tunable parameter, S seconds after the first sample (default before it); may be repeated",
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Write the recording, and draw each signal in one line."""
    from firmloop.identify.recordings.recording import write_recording
    from firmloop.output import results_file
    from firmloop.presentation.monitor_words import picture, sparks
    from firmloop.project.project import campaign_targets, read_project
    from firmloop.stages.board.monitoring import Watch, monitor
    from firmloop.told import tell_watched

    project = read_project(arguments.project)
    target = campaign_targets(project, (arguments.target,))[0]
    names, settings = ask.names(arguments.signals), tuple(arguments.settings)
    watch = Watch(arguments.port, target, names, arguments.every, arguments.seconds, settings, arguments.live)

    def watching(tape: Tape, channels: Sequence[Channel], period: float) -> AbstractContextManager[Progress]:
        return progress("watching", lambda: picture(tape, channels, period * watch.every))

    with results_file(arguments.out) as partial:
        found = monitor(project, watch, arguments.out.name, progress, watching)
        write_recording(found.recording, partial)
    console.lines([f"{name:>24} |{sparks(values)}|" for name, values in found.recording.columns.items()])
    return tell_watched(console, found, watch.every, arguments.out)
