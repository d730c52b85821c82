"""`firmloop explain`: what a key, an effect, a plant kind or a controller kind means."""

from __future__ import annotations

import argparse

from firmloop.console import Console

NAME = "explain"
HELP = "what a key of the project file, an effect, a plant, a controller or a tuning rule means"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the name."""
    parser.add_argument(
        "name", metavar="NAME", help="such as period_s, plant.parameters, coulomb_friction, dc_motor, pid, simc"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show every passage of the reference pages about the name."""
    from firmloop.presentation.reference_words import explained

    passages = explained(arguments.name)
    console.lines("\n\n".join(passages).splitlines())
    console.result("explain", list(passages))
    return 0
