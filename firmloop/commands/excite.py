"""`firmloop excite`: an excitation signal for the bench."""

from __future__ import annotations

import argparse

from firmloop import arguments as ask
from firmloop.console import Console

NAME = "excite"
HELP = "an excitation signal for the bench; DIR/excitation.csv and its C table"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for the project and the folder of the results."""
    ask.project_and_place(parser, "DIR")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Leave DIR/excitation.csv to be played, and DIR/<name>_excitation.c with its header to be compiled in."""
    from firmloop.codegen.bundle import write_files
    from firmloop.identify.recordings.recording import write_recording
    from firmloop.identify.units import unit_of
    from firmloop.output import results_folder, written
    from firmloop.project.project import read_project
    from firmloop.stages.bench.excitation import FULL_BAND, excite

    project = read_project(arguments.project)
    with results_folder(arguments.out, ()) as folder:
        made = excite(project)
        write_recording(made.recording, folder / "excitation.csv")
        write_files(made.c_files, folder)
    time, values = made.recording.time, made.recording.columns[made.input]
    console.lines(
        [
            f"excitation: {made.kind} of {made.input}, {len(time)} samples of {time[1] - time[0]:g} s, "
            f"{values.min():.4g} to {values.max():.4g} {unit_of(made.input)}",
            f"  {FULL_BAND:.0%} of its power lies within {made.band[0]:.3g} and {made.band[1]:.3g} Hz",
        ]
    )
    told = {"signal": made.kind, "input": made.input, "samples": len(time), "band_Hz": list(made.band)}
    console.result("excitation", told)
    written(console, arguments.out, ("excitation.csv", *made.c_files))
    return 0
