"""`firmloop monitor`: watch a controller that runs by itself."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, progress

NAME = "monitor"
HELP = "watch a controller that runs by itself; FILE.csv is a recording"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project, the file of the recording, the board, and what to watch and set."""
    ask.project_and_place(parser, "FILE.csv")
    parser.add_argument("--target", required=True, metavar="NAME", help="the board, as `firmloop targets` calls it")
    parser.add_argument(
        "--port", required=True, metavar="URL", help="where it is: /dev/ttyACM0, COM3, socket://host:port"
    )
    parser.add_argument(
        "--signals", default="", metavar="A,B", help="inputs, outputs, parameters, status (default inputs, outputs)"
    )
    parser.add_argument("--every", type=ask.steps, default=1, metavar="N", help="only every Nth step (default 1)")
    parser.add_argument("--seconds", type=_seconds, default=10.0, metavar="S", help="how long (default 10)")
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
    from firmloop.presentation.monitor_words import about_settings, set_document, sparks
    from firmloop.project.project import campaign_targets, read_project
    from firmloop.stages.board.monitoring import Watch, monitor

    project = read_project(arguments.project)
    target = campaign_targets(project, (arguments.target,))[0]
    names = tuple(part.strip() for part in arguments.signals.split(",") if part.strip())
    settings = tuple(arguments.settings)
    watch = Watch(arguments.port, target, names, arguments.every, arguments.seconds, settings)
    with results_file(arguments.out) as partial:
        found = monitor(project, watch, arguments.out.name, progress)
        write_recording(found.recording, partial)
    seen, every = found.seen, watch.every * found.program.period
    console.lines([f"{name:>24} |{sparks(values)}|" for name, values in found.recording.columns.items()])
    console.lines(
        [
            *about_settings(found.program, found.settings, seen),
            f"{len(seen.rows):,} samples of {', '.join(found.names)}, every {every:g} s; "
            f"lost: {seen.lost_in_image} in the image, {seen.lost_on_line} on the line",
            f"the controller ran {found.steps:,} steps, {found.late} of them late",
            f"written: {arguments.out}",
        ]
    )
    console.result("samples", len(seen.rows))
    console.result("lost", {"image": seen.lost_in_image, "line": seen.lost_on_line})
    console.result("set", set_document(found.program, found.settings, seen))
    console.result("late_steps", found.late)
    console.result("written", [str(arguments.out)])
    return 0


def _seconds(text: str) -> float:
    return ask.number(text, 0.001, 1e6)
