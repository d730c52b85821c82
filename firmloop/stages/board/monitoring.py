"""Watch a running controller and set its parameters; what it does becomes a recording that `identify` reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.target import load_target
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectError
from firmloop.quantize.program import Program
from firmloop.stages.board.channels import Channel, channels
from firmloop.stages.board.linking import live_link
from firmloop.stages.board.stopping import stop_in_order
from firmloop.stages.board.taking import Due, Extent, schedule, take
from firmloop.stages.board.tape import Seen, Setting, Tape
from firmloop.stages.board.tunables import setting_of
from firmloop.stages.making import Generated, design, generate
from firmloop.stages.plant import command_of, plant_of
from firmloop.stages.progress import Report, Stage
from firmloop.verify.link import LinkError
from firmloop.verify.links.live import LiveLink

MOST_SAMPLES = 50_000_000  # of a watch; with ten signals they take 2 GB
MOST_STEPS = 2**32 - 1  # that the image counts before it begins anew

Watching = Callable[[Tape, Sequence[Channel], float], AbstractContextManager[Report]]  # told the period, in s


@dataclass(frozen=True, slots=True)
class Watch:
    """What to watch and where: on a port, or on an emulated core with the functions of the C file `live`.

    `signals` are names of inputs, outputs, parameters or `status`; `seconds` are of the controller's time, None for as
    long as memory holds.
    """

    port: str | None
    target: str
    signals: tuple[str, ...]
    every: int
    seconds: float | None
    settings: tuple[tuple[str, float, float], ...] = ()  # parameter, value in its unit, s after the first sample
    live: Path | None = None


@dataclass(frozen=True, slots=True)
class Watched:
    """What a watch has seen: its recording, what was set, and how many steps the controller made and was late in.

    `steps` and `late` are None where it could not be asked any more; `gone` says why the line ended before its time.
    """

    program: Program
    recording: Recording
    channels: tuple[Channel, ...]
    seen: Seen
    steps: int | None
    late: int | None
    stopped: bool  # by somebody, before its time
    gone: str


def program_of(project: Project, verb: str) -> Generated:
    """Return the program that runs, and its C.

    Raises
    ------
    ProjectError
        when the project has no whole controller.
    """
    require(project, "controller", "signals", "arithmetic")
    plant = plant_of(project) if project.plant else None
    return generate(project, design(project, plant), command_of(verb, project.path))


def monitor(project: Project, watch: Watch, name: str, stage: Stage, watching: Watching) -> Watched:
    """Stream the signals for a while, or until somebody stops it; the recording is called `name`.

    `watching` is opened with what comes while it comes.

    Raises
    ------
    ProjectError
        when a signal or parameter is unknown, or a value beyond its range.
    LinkError
        when the controller does not answer.
    """
    generated = program_of(project, "monitor")
    program = generated.program
    settings = settings_of(program, watch)
    watched = channels(project, program, watch.signals, [setting.name for setting in settings])
    extent = extent_of(program, watch, watched)
    target = load_target(watch.target)
    with live_link(project, generated, target, watch.port, watch.live, stage) as link:
        tape = Tape(watch.every)
        with watching(tape, watched, program.period) as report:
            return record(link, program, watched, extent, tape, schedule(settings), name, report)


def settings_of(program: Program, watch: Watch) -> tuple[Setting, ...]:
    """Return what is to be set, in the order of its time, as the controller holds it."""
    found = []
    for name, value, seconds in watch.settings:
        after = round(seconds / program.period)
        try:
            setting = setting_of(program, name, value, after)
        except ProjectError as error:
            raise ProjectError(f"--set {error}") from None
        if watch.seconds is not None and after >= max(1, round(watch.seconds / program.period) - watch.every):
            raise ProjectError(
                f"--set {name}={value:g}@{seconds:g}: comes after the last sample; watch for longer (--seconds)"
            )
        found.append(setting)
    return tuple(sorted(found, key=lambda setting: setting.after))


def extent_of(program: Program, watch: Watch, watched: Sequence[Channel]) -> Extent:
    """Return what is to be taken.

    Raises
    ------
    ProjectError
        when it would be more than memory holds.
    """
    names = tuple(channel.name for channel in watched)
    if watch.seconds is None:
        return Extent(names, watch.every, min(MOST_SAMPLES * watch.every, MOST_STEPS))
    samples = watch.seconds / program.period / watch.every
    if samples > MOST_SAMPLES:
        raise ProjectError(
            f"--seconds {watch.seconds:g}: makes {samples:.3g} samples of {program.period * watch.every:g} s; at most "
            f"{MOST_SAMPLES:,}: watch for less, or only every so many steps (--every)"
        )
    return Extent(names, watch.every, round(watch.seconds / program.period))


def record(
    link: LiveLink,
    program: Program,
    watched: tuple[Channel, ...],
    extent: Extent,
    tape: Tape,
    due: Due,
    name: str,
    report: Report,
) -> Watched:
    """Take samples until their time is over, somebody stops it or the line goes; the last two keep what came.

    Raises
    ------
    LinkError
        when nothing came at all.
    """
    gone, after = "", None
    before = link.state()
    with stop_in_order() as stopped:
        try:
            take(link, extent, tape, due, stopped, report)
            after = link.state()
        except LinkError as error:
            if not len(tape):
                raise
            gone = str(error)
        finally:
            tape.close()
    if not len(tape):
        raise KeyboardInterrupt
    seen = tape.seen(extent.steps)
    recording = recording_of(program, watched, seen.rows, name)
    steps, late = (after.steps - before.steps, after.late - before.late) if after else (None, None)
    return Watched(program, recording, watched, seen, steps, late, stopped(), gone)


def recording_of(program: Program, watched: Sequence[Channel], rows: NDArray[np.void], name: str) -> Recording:
    """Return rows as a recording that begins at 0 s."""
    elapsed = (rows["step"] - rows["step"][0]).astype(np.float64) * program.period
    return make_recording(elapsed, {channel.column: channel.physical(rows) for channel in watched}, name, "")
