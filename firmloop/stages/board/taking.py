"""Take the samples of a running controller onto a tape, and set its parameters between two of its steps.

A parameter is set once the sample of the asked time has come over the line: some milliseconds after it. Its column in
the recording is what the controller held at each step, so it tells the very sample.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from firmloop.stages.board.tape import Made, Setting, Tape
from firmloop.stages.board.watching import Watching
from firmloop.verify.links.live import LiveLink

WAIT = 0.5  # s for samples before the clock is looked at again

Due = Callable[[int], Iterable[Setting]]  # told how many steps have passed, gives what is to be set now
Done = Callable[[Made], None]


@dataclass(frozen=True, slots=True)
class Extent:
    """Which members to take, of every how many steps, over how many steps of the controller."""

    names: tuple[str, ...]
    every: int
    steps: int


def take(
    link: LiveLink,
    extent: Extent,
    tape: Tape,
    due: Due,
    stopped: Callable[[], bool],
    report: Callable[[float, str], None],
) -> None:
    """Take samples until those of all steps are there or somebody stops it; step numbers tell which are missing.

    Raises
    ------
    LinkError
        when none come any more, or a value is refused; what came before is on the tape.
    """
    course = Watching(link.period, extent.every, time.monotonic())
    _set(link, tape, due(0), course)
    link.watch(extent.names, extent.every)
    course = replace(course, begun_at=time.monotonic())
    while course.passed < max(1, extent.steps - extent.every) and not stopped():
        for part in link.samples(WAIT):
            if len(part.rows):
                course = course.after(part.rows["step"], time.monotonic())
                tape.append(part.rows, part.lost, course.passed)
        if course.begun:
            _set(link, tape, due(course.passed), course)
            report(min(1.0, course.passed / max(1, extent.steps)), f"{course.passed:,} steps")
        course.check(extent.steps, time.monotonic())


def _set(link: LiveLink, tape: Tape, settings: Iterable[Setting], course: Watching) -> None:
    for setting in settings:
        made = Made(setting, link.set(setting.name, setting.value))
        course.check_set(setting.name, made.step, time.monotonic())
        tape.note(made)


def schedule(settings: Sequence[Setting]) -> Due:
    """Return what is due of settings that stand in the order of their time."""
    waiting = list(settings)

    def due(passed: int) -> Iterator[Setting]:
        while waiting and waiting[0].after <= passed:
            yield waiting.pop(0)

    return due


def never() -> bool:
    """Stop at nothing."""
    return False
