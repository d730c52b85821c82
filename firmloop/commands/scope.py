"""`firmloop scope`: watch a running controller in a browser, and move its parameters."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, announce, progress

NAME = "scope"
HELP = "watch a running controller in a browser, with sliders for its tunable parameters; FILE.csv is a recording"
SPELLINGS = ("teleplot", "serial-studio")
MOST_PORT = 65_535


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the file of the recording, the controller, and who else is to see its samples."""
    ask.project_and_place(parser, "FILE.csv")
    ask.watched(parser)
    parser.add_argument("--seconds", type=ask.seconds, metavar="S", help="how long (default: until Ctrl-C)")
    parser.add_argument("--page-port", type=_port, default=0, metavar="N", help="of the page (default: any free one)")
    parser.add_argument("--lines", choices=SPELLINGS, help="print every sample too, for another plotting program")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show the page until Ctrl-C, then write the recording."""
    from firmloop.identify.recordings.recording import write_recording
    from firmloop.output import results_file
    from firmloop.project.project import campaign_targets, read_project
    from firmloop.scope.lines import spelling_of
    from firmloop.scope.scope import Onlookers, scope
    from firmloop.stages.board.monitoring import Watch
    from firmloop.told import tell_watched

    project = read_project(arguments.project)
    target = campaign_targets(project, (arguments.target,))[0]
    watch = Watch(
        arguments.port, target, ask.names(arguments.signals), arguments.every, arguments.seconds, (), arguments.live
    )

    def opened(url: str) -> None:
        announce(f"open {url}\nthe page shows {project.name}; Ctrl-C ends it and writes {arguments.out}")

    onlookers = Onlookers(arguments.page_port, opened, spelling_of(arguments.lines), console.lines)
    with results_file(arguments.out) as partial:
        found = scope(project, watch, onlookers, arguments.out.name, progress)
        write_recording(found.recording, partial)
    return tell_watched(console, found, watch.every, arguments.out)


def _port(text: str) -> int:
    return ask.whole(text, 0, MOST_PORT)
