"""`firmloop diagnose`: where simulation and recordings differ, and why; of one machine, or of many of one type."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from firmloop import arguments as ask
from firmloop.console import Console, complain, progress

if TYPE_CHECKING:
    from firmloop.stages.fleet.pools.pool import Pool

NAME = "diagnose"
HELP = (
    "say where simulation and recordings differ and why; DIR/diagnosis.json, DIR/report.html; with --fleet, which of "
    "many machines is different; DIR/fleet.json, DIR/fleet.html"
)

NOTHING, FOUND, NONE_READ, NOT_DONE = 0, 1, 2, 3
MOST_WORKERS = 1024


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results; of a fleet, for its recordings and where to diagnose them."""
    ask.project_and_place(parser, "DIR")
    parser.add_argument(
        "--fleet",
        metavar="DIR|GLOB",
        help="recordings of many machines of this type: a file, or a folder of files, each",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=_workers, metavar="N", help="processes for --fleet (default: all processors)")
    where.add_argument("--dask", metavar="ADDRESS", help="a Dask cluster for --fleet, such as tcp://host:8786")
    where.add_argument("--ray", metavar="ADDRESS", help="a Ray cluster for --fleet, such as ray://host:10001")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/diagnosis.json, an improved DIR/project.toml and DIR/report.html; or the results of a fleet."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.diagnose import diagnose
    from firmloop.door.load import load
    from firmloop.output import results_folder

    if arguments.fleet is not None:
        return _fleet(arguments, console)
    _alone(arguments)
    project, out = load(arguments.project), arguments.out
    with results_folder(out, ()) as folder:
        made = diagnose(project, stage=progress)
        with progress("writing the report"):
            files = made.files(out)
        write_files(files, folder)
    console.lines([f"verdict: {made.finding.verdict}", *made.finding.says])
    console.lines([f"written to {out}: {', '.join(files)}"])
    for key, value in made.finding.as_dict().items():
        console.result(key, value)
    return NOTHING if made.finding.verdict == "no_mismatch" else FOUND


def _alone(arguments: argparse.Namespace) -> None:
    from firmloop.project.table import ProjectError

    for option in ("workers", "dask", "ray"):
        if getattr(arguments, option) is not None:
            raise ProjectError(f"--{option}: is for a fleet; add --fleet DIR, or leave it out")


def _fleet(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/fleet.json, DIR/fleet.html, a table of all figures, and DIR/machines with what each recording said."""
    from firmloop.codegen.bundle import write_files
    from firmloop.door.diagnose_fleet import diagnose_fleet
    from firmloop.door.load import load
    from firmloop.output import results_folder
    from firmloop.presentation.fleet.words import about_fleet, fleet_document

    out = arguments.out
    made = diagnose_fleet(load(arguments.project), arguments.fleet, out, pool=_pool(arguments), stage=progress)
    with results_folder(out, ("fleet.parquet",)) as folder:
        files = made.files()
        write_files(files, folder)
        parquet = made.parquet()
        if parquet is not None:
            (folder / "fleet.parquet").write_bytes(parquet)
    console.lines(about_fleet(made.members, made.compared))
    if made.taken:
        console.lines([f"taken from an earlier run: {made.taken} of {len(made.members)} recordings"])
    names = [*files, "fleet.parquet"] if parquet is not None else [*files]
    console.lines([f"written to {out}: {', '.join(names)}"])
    if parquet is None:
        console.lines(["no fleet.parquet: pyarrow is not installed (pip install 'firmloop[parquet]')"])
    for key, value in fleet_document(made.members, made.compared, made.failed).items():
        console.result(key, value)
    for name, why in made.failed.items():
        complain(f"{name} was not diagnosed: {why}")
    if made.failed:
        return NOT_DONE
    if all(one.refused for one in made.members):
        complain(f"{arguments.fleet}: none of its recordings could be used, so that no machine was looked at")
        return NONE_READ
    return FOUND if made.compared.different else NOTHING


def _pool(arguments: argparse.Namespace) -> Pool:
    from firmloop.stages.fleet.pools.dask import dask
    from firmloop.stages.fleet.pools.local import local, processors
    from firmloop.stages.fleet.pools.ray import ray

    if arguments.dask is not None:
        return dask(arguments.dask)
    return ray(arguments.ray) if arguments.ray is not None else local(arguments.workers or processors())


def _workers(text: str) -> int:
    return ask.whole(text, 1, MOST_WORKERS)
