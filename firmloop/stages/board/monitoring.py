"""Watch a running controller and set its parameters; what it does becomes a recording that `identify` reads as it is.

A parameter is set between two steps, once the sample of the asked time has come over the line: some milliseconds after
it. Its column in the recording is what the controller held at each step, so it tells the very sample.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import load_target
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.quantize.program import Program
from firmloop.stages.board.watching import Watching
from firmloop.stages.making import design, generate
from firmloop.stages.plant import command_of, plant_of
from firmloop.stages.progress import Stage
from firmloop.verify.links.live import STATUS, LiveLink, Samples, open_live_port, watchable
from firmloop.verify.reference import Raw
from firmloop.verify.scaling import to_physical, to_raw

WAIT = 0.5  # s for samples before the clock is looked at again
MOST_SAMPLES = 50_000_000  # of a watch; with ten signals they take 2 GB


@dataclass(frozen=True, slots=True)
class Watch:
    """What to watch: names of inputs, outputs or `status`; every how many steps; for how many seconds of its time."""

    port: str
    target: str
    signals: tuple[str, ...]
    every: int
    seconds: float
    settings: tuple[tuple[str, float, float], ...] = ()  # parameter, value in its unit, s after the first sample


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter to be set to the raw `value` (1,) once `after` steps have been seen; before the first one if 0."""

    name: str
    value: Raw
    after: int


@dataclass(frozen=True, slots=True)
class Seen:
    """What came: raw rows in order, samples lost in the image for want of line, and on the line."""

    rows: NDArray[np.void]
    lost_in_image: int
    lost_on_line: int
    set_from: tuple[int, ...] = ()  # a setting each: the first step that it acted on


def stream(
    link: LiveLink,
    names: Sequence[str],
    every: int,
    steps: int,
    report: object,
    settings: Sequence[Setting] = (),  # in the order of their time
) -> Seen:
    """Take samples over `steps` steps of the controller; its step numbers tell which are missing.

    Raises
    ------
    LinkError
        when none come, or a value is refused.
    """
    waiting = list(settings)
    set_from = []
    while waiting and waiting[0].after == 0:
        set_from.append(link.set(waiting[0].name, waiting.pop(0).value))
    link.watch(tuple(names), every)
    parts: list[Samples] = []
    course = Watching(link.period, every, time.monotonic())
    while course.passed < max(1, steps - every):
        for part in link.samples(WAIT):
            if len(part.rows):
                parts.append(part)
                course = course.after(part.rows["step"], time.monotonic())
        while waiting and course.begun and course.passed >= waiting[0].after:
            set_from.append(link.set(waiting[0].name, waiting.pop(0).value))
        course.check(steps, time.monotonic())
        if callable(report) and course.begun:
            report(min(1.0, course.passed / max(1, steps)), f"{course.passed:,} steps")
    rows = np.concatenate([part.rows for part in parts])
    passed = rows["step"] - rows["step"][0]  # of 32 bits, as the steps are: right where they begin anew
    rows, passed = rows[passed < steps], passed[passed < steps]
    missing = int(passed[-1]) // every + 1 - len(rows)
    in_image = min(missing, parts[-1].lost)
    return Seen(rows, in_image, missing - in_image, tuple(set_from))


def settings_of(program: Program, watch: Watch) -> tuple[Setting, ...]:
    """Return what is to be set, in the order of its time, as the controller holds it."""
    parameters = {parameter.name: parameter for parameter in program.parameters}
    found = []
    for name, value, seconds in watch.settings:
        if name not in parameters:
            raise ProjectError(
                f"--set {name}: is no tunable parameter of {program.name}; "
                f"tunable: {', '.join(parameters) or 'none, see [controller] tunable'}"
            )
        parameter = parameters[name]
        raw = to_raw(parameter, np.array([value]))
        if not parameter.low <= raw[0] <= parameter.high:
            low, high = to_physical(parameter, np.array([parameter.low, parameter.high]))
            raise ProjectError(
                f"--set {name}={value:g}: is beyond its proven range, {low:.6g} to {high:.6g} "
                f"{parameter.unit or '1'}; to go there, widen controller.ranges.{name} and flash the program anew"
            )
        after = round(seconds / program.period)
        if after >= max(1, round(watch.seconds / program.period) - watch.every):
            raise ProjectError(
                f"--set {name}={value:g}@{seconds:g}: comes after the last sample; watch for longer (--seconds)"
            )
        found.append(Setting(name, raw, after))
    return tuple(sorted(found, key=lambda setting: setting.after))


def _chosen(program: Program, asked: Sequence[str], tuned: Sequence[str]) -> tuple[str, ...]:
    known = watchable(program)
    wires = [value.name for value in (*program.inputs, *program.outputs)]
    for name in asked:
        if name not in known:
            raise ProjectError(f"--signals {name}: is no signal of {program.name}; known: {', '.join(known)}")
    return tuple(name for name in known if name in (asked or wires) or name in tuned)


def _columns(
    project: Project, program: Program, names: Sequence[str], rows: NDArray[np.void]
) -> Mapping[str, NDArray[np.float64]]:
    """Return physical columns, named as recordings name them: the plant's own names where a wire is one of its ends."""
    values = {value.name: value for value in (*program.inputs, *program.outputs, *program.parameters)}
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


@dataclass(frozen=True, slots=True)
class Watched:
    """What a watch has seen: its recording, what was set, and how many steps the controller made and was late in."""

    program: Program
    recording: Recording
    names: tuple[str, ...]
    settings: tuple[Setting, ...]
    seen: Seen
    steps: int
    late: int


def monitor(project: Project, watch: Watch, name: str, stage: Stage) -> Watched:
    """Stream the signals for a while; the recording is called `name`.

    Raises
    ------
    ProjectError
        when a signal or parameter is unknown, or a value beyond its range.
    LinkError
        when the controller does not answer.
    """
    require(project, "controller", "signals", "arithmetic")
    plant = plant_of(project) if project.plant else None
    program = generate(project, design(project, plant), command_of("monitor", project.path)).program
    samples = watch.seconds / program.period / watch.every
    if samples > MOST_SAMPLES:
        raise ProjectError(
            f"--seconds {watch.seconds:g}: makes {samples:.3g} samples of {program.period * watch.every:g} s; at most "
            f"{MOST_SAMPLES:,}: watch for less, or only every so many steps (--every)"
        )
    settings = settings_of(program, watch)
    names = _chosen(program, watch.signals, [setting.name for setting in settings])
    with open_live_port(load_target(watch.target), watch.port, program) as link:
        before = link.state()
        with stage(f"watching {watch.port}") as report:
            seen = stream(link, names, watch.every, round(watch.seconds / program.period), report, settings)
        after = link.state()
    elapsed = (seen.rows["step"] - seen.rows["step"][0]).astype(np.float64) * program.period
    recording = make_recording(elapsed, _columns(project, program, names, seen.rows), name, "")
    return Watched(program, recording, names, settings, seen, after.steps - before.steps, after.late - before.late)
