"""Watch a running controller, and write what it does as a recording that `identify` and `diagnose` read as it is."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codegen.target import Target, load_target
from firmloop.console import Console, progress
from firmloop.output import results_file
from firmloop.pipeline import command_of, design, generate, plant_of
from firmloop.project import Project, require
from firmloop.table import ProjectError
from identify.recording import make_recording, write_recording
from quantize.program import Program
from verify.links import LinkError
from verify.links.live import STATUS, LiveLink, Samples, open_live_port, watchable
from verify.stimuli import to_physical

WAIT = 0.5  # s for samples before the clock is looked at again
BARS = " .:-=+*#%@"  # of the terminal's plot, from low to high
PLOT_WIDTH = 60


@dataclass(frozen=True, slots=True)
class Watch:
    """What to watch: names of inputs, outputs or `status`; every how many steps; for how many seconds of its time."""

    port: str
    target: str
    signals: tuple[str, ...]
    every: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Seen:
    """What came: raw rows in order, samples lost in the image for want of line, and on the line."""

    rows: NDArray[np.void]
    lost_in_image: int
    lost_on_line: int


def monitor(project: Project, watch: Watch, out: Path, console: Console) -> int:
    """Stream the signals for a while and write the recording OUT."""
    require(project, "controller", "signals", "arithmetic")
    plant = plant_of(project) if project.plant else None
    program = generate(project, design(project, plant), command_of("monitor", project.path)).program
    names = _chosen(program, watch.signals)
    target: Target = load_target(watch.target)
    with results_file(out) as partial, open_live_port(target, watch.port, program) as link:
        before = link.state()
        with progress(f"watching {watch.port}") as bar:
            seen = stream(link, names, watch.every, round(watch.seconds / program.period), bar)
        after = link.state()
        columns = _columns(project, program, names, seen.rows)
        elapsed = (seen.rows["step"] - seen.rows["step"][0]).astype(np.float64) * program.period
        write_recording(make_recording(elapsed, columns, out.name, ""), partial)
    console.lines([f"{name:>24} |{_sparks(values)}|" for name, values in columns.items()])
    console.lines(
        [
            f"{len(seen.rows):,} samples of {', '.join(names)}, every {watch.every * program.period:g} s; "
            f"lost: {seen.lost_in_image} in the image, {seen.lost_on_line} on the line",
            f"the controller ran {after.steps - before.steps:,} steps, {after.late - before.late} of them late",
            f"written: {out}",
        ]
    )
    console.result("samples", len(seen.rows))
    console.result("lost", {"image": seen.lost_in_image, "line": seen.lost_on_line})
    console.result("late_steps", after.late - before.late)
    console.result("written", [str(out)])
    return 0


def stream(link: LiveLink, names: Sequence[str], every: int, steps: int, report: object) -> Seen:
    """Take samples over `steps` steps of the controller; its step numbers tell which are missing.

    Raises
    ------
    LinkError
        when none come.
    """
    link.watch(tuple(names), every)
    parts: list[Samples] = []
    silent = time.monotonic()
    first = last = -1
    while first < 0 or last - first < steps - every:
        for part in link.samples(WAIT):
            if len(part.rows):
                parts.append(part)
                first = int(part.rows["step"][0]) if first < 0 else first
                last = int(part.rows["step"][-1])
                silent = time.monotonic()
        if time.monotonic() - silent > 4 * WAIT + 2 * every:
            raise LinkError("the controller sends no samples any more: was it reset?")
        if callable(report) and first >= 0:
            report(min(1.0, (last - first) / max(1, steps)), f"{last - first:,} steps")
    rows = np.concatenate([part.rows for part in parts])
    rows = rows[rows["step"] < first + steps]
    missing = (int(rows["step"][-1]) - first) // every + 1 - len(rows)
    in_image = min(missing, parts[-1].lost)
    return Seen(rows, in_image, missing - in_image)


def _chosen(program: Program, asked: Sequence[str]) -> tuple[str, ...]:
    known = watchable(program)
    for name in asked:
        if name not in known:
            raise ProjectError(f"--signals {name}: is no signal of {program.name}; known: {', '.join(known)}")
    return tuple(name for name in known if name in asked) or tuple(name for name in known if name != STATUS)


def _columns(
    project: Project, program: Program, names: Sequence[str], rows: NDArray[np.void]
) -> Mapping[str, NDArray[np.float64]]:
    """Return physical columns, named as recordings name them: the plant's own names where a wire is one of its ends."""
    values = {value.name: value for value in (*program.inputs, *program.outputs)}
    columns = {}
    for name in names:
        if name == STATUS:
            columns["controller_status"] = rows[name].astype(np.float64)
            continue
        value = values[name]
        columns[_column(project, program, name, value.unit)] = to_physical(value, rows[name])
    return columns


def _column(project: Project, program: Program, name: str, unit: str) -> str:
    plant = project.plant
    if plant is not None and name == "measurement":
        return plant.outputs[0]
    if plant is not None and name == program.outputs[0].name and len(program.outputs) == 1:
        return plant.input
    if plant is not None and name == "reference":
        return f"reference_{plant.outputs[0].partition('_')[2]}"
    suffix = re.sub(r"[^A-Za-z0-9]+", "_", unit).strip("_")
    return f"{name}_{suffix}" if suffix else name


def _sparks(values: NDArray[np.float64]) -> str:
    """Draw a column in one line of characters: the mean of each stretch, from its lowest to its highest value."""
    means = np.array([part.mean() for part in np.array_split(values, min(PLOT_WIDTH, len(values)))])
    span = float(np.ptp(means)) or 1.0
    places = ((means - means.min()) / span * (len(BARS) - 1)).round().astype(int)
    return "".join(BARS[place] for place in places)
