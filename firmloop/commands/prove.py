"""`firmloop prove`: let judges prove a delivered controller, or one that a project makes."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop import arguments as ask
from firmloop.console import Console, progress, table

if TYPE_CHECKING:
    from firmloop.verify.proofs.judge import Judge

NAME = "prove"
HELP = "prove a delivered proof.json again, and that the C beside it states what it proves; or those of a project"

PROVEN, REFUTED, UNDECIDED = 0, 1, 3


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the folder that was delivered, or for a project and where its C goes; and for judges."""
    parser.add_argument(
        "folder", type=ask.place, metavar="DIR|PROJECT", help="the folder that `firmloop generate` wrote, or a project"
    )
    parser.add_argument("--out", type=ask.place, metavar="DIR", help="of a project: where C and proofs.json go")
    parser.add_argument(
        "--judge", action="append", metavar="NAME", help="one judge instead of all installed; may be repeated"
    )


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Prove DIR/proof.json again, and that the C in DIR states what it proves."""
    from firmloop.stages.proving import NOT_JUDGED, chosen, prove

    judges = chosen(arguments.judge or ())
    folder = _folder(arguments.folder, arguments.out, judges, console)
    with progress("asking the judges"):
        found = prove(folder, judges)
    claims, undecided = found.claims, found.undecided
    said = [
        (
            f"{one.judge} {one.version}".rstrip(),
            f"{one.result}, {one.seconds:.1f} s" + (f": {one.says}" * bool(one.says)),
        )
        for one in (*found.judgements, *found.absent)
    ]
    console.lines(
        [
            f"{folder}: {claims.name}, {claims.arithmetic}, program {claims.program_id}",
            *table(found.judged),
            *table(said),
            *(
                [f"refuted: {found.refuted}"]
                if found.refuted
                else [f"  not judged here: {what}" for what in NOT_JUDGED]
            ),
            *([f"not proven: {', '.join(f'{one.judge}: {one.result}' for one in undecided)}"] if undecided else []),
            *([] if found.refuted or undecided else ["proven"]),
        ]
    )
    proofs = [one.as_dict() for one in (*found.judgements, *found.absent)]
    proven = not found.refuted and not undecided
    verdict = {"program_id": claims.program_id, "proven": proven, "refuted": found.refuted or None}
    console.result("proof", verdict | {"judged": dict(found.judged), "not_judged": list(NOT_JUDGED), "proofs": proofs})
    if arguments.out is not None:
        from firmloop.codegen.bundle import write_files

        text = json.dumps({"schema": 1, **verdict, "proofs": proofs}, indent=2)
        write_files({"proofs.json": f"{text}\n"}, arguments.out)
    if found.refuted:
        return REFUTED
    return UNDECIDED if undecided else PROVEN


def _folder(given: Path, out: Path | None, named: Sequence[Judge], console: Console) -> Path:
    """Return the folder to judge; of a project, the one that its C has gone to, and images if they are judged."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.generate import generate
    from firmloop.door.load import load
    from firmloop.output import results_folder
    from firmloop.project.table import ProjectError
    from firmloop.stages.board.images import link_images
    from firmloop.stages.forever.certificate import certificate
    from firmloop.stages.proving import CERTIFICATE, judged
    from firmloop.verify.proofs.judge import IMAGES, LOOP
    from firmloop.verify.proofs.reading import read_claims

    if not given.is_file():
        return given
    if given.name == "proof.json":
        return given.parent
    if given.suffix == ".json":
        raise ProjectError(f"{given}: is no project; give the folder that `firmloop generate` wrote, or its proof.json")
    if out is None:
        raise ProjectError(f"{given}: of a project, --out DIR says where its C goes")
    project = load(given)
    with results_folder(out, (f"{IMAGES}/*.elf", CERTIFICATE)) as folder:
        code = generate(project, stage=progress)
        write_files(code.files, folder)
        if judged(named, LOOP):
            with progress("bounding the loop for all time"):
                claims = read_claims(json.loads(code.files["proof.json"]))
                found = certificate(project, code.design, code.plant, code.program, claims)
            if named or found["found"]:
                write_files({CERTIFICATE: f"{json.dumps(found, indent=1)}\n"}, folder)
            else:  # nobody asked for it by name, and there is nothing to judge
                console.lines([f"not bounded for ever: {found['why']}"])
        if judged(named, IMAGES):
            with progress("linking the images"):
                link_images(project, code.generated, folder)
    return out
