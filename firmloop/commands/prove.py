"""`firmloop prove`: judge a delivered proof.json, and the C beside it."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console, table

NAME = "prove"
HELP = "prove a delivered proof.json again, and that the C beside it states what it proves"

PROVEN, REFUTED = 0, 1


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the folder that was delivered."""
    parser.add_argument("folder", type=ask.place, metavar="DIR", help="the folder that `firmloop generate` wrote")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Prove DIR/proof.json again, and that the C in DIR states what it proves."""
    from firmloop.stages.proving import NOT_JUDGED, prove

    folder = arguments.folder
    found = prove(folder)
    claims = found.claims
    console.lines(
        [
            f"{folder}: {claims.name}, {claims.arithmetic}, program {claims.program_id}",
            *table(found.judged),
            *(
                [f"refuted: {found.refuted}"]
                if found.refuted
                else [f"  not judged here: {what}" for what in NOT_JUDGED]
            ),
            *([] if found.refuted else ["proven"]),
        ]
    )
    verdict = {"program_id": claims.program_id, "proven": not found.refuted, "refuted": found.refuted or None}
    console.result("proof", verdict | {"judged": dict(found.judged), "not_judged": list(NOT_JUDGED)})
    return REFUTED if found.refuted else PROVEN
