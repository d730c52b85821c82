"""Watch a controller with a page in a browser, until its time is over or somebody stops it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace

from firmloop.codegen.target import load_target
from firmloop.project.project import Project
from firmloop.quantize.program import Program
from firmloop.scope.display import Display, held_of
from firmloop.scope.lines import Spelling
from firmloop.scope.server import served
from firmloop.stages.board.channels import channels
from firmloop.stages.board.desk import Desk
from firmloop.stages.board.linking import live_link
from firmloop.stages.board.monitoring import Watch, Watched, extent_of, program_of, record
from firmloop.stages.board.taking import Extent, never, schedule, take
from firmloop.stages.board.tape import Tape
from firmloop.stages.progress import Stage, quietly
from firmloop.verify.links.live import LiveLink

MOST_LINES = 1_000  # rows that are spelled at once
SILENCE = 1.0  # s


@dataclass(frozen=True, slots=True)
class Onlookers:
    """Who is told: of the page's URL, and of every sample in the lines of `spelling`."""

    port: int  # of the page, 0 for any free one
    opened: Callable[[str], None]
    spelling: Spelling | None
    lines: Callable[[Iterable[str]], None]


def scope(project: Project, watch: Watch, onlookers: Onlookers, name: str, stage: Stage) -> Watched:
    """Show a running controller in a browser; return all that was seen, as `monitor` does.

    Raises
    ------
    ProjectError
        when a signal is unknown, or the page's port is taken.
    LinkError
        when the controller does not answer.
    """
    generated = program_of(project, "scope")
    program, target = generated.program, load_target(watch.target)
    shown = channels(project, program, watch.signals, ())
    extent = extent_of(program, watch, shown)
    with live_link(project, generated, target, watch.port, watch.live, stage) as link:
        tape = Tape(watch.every)
        desk = Desk(tape)
        display = Display(target.name, program, shown, tape, desk, watch.every, _held(link, program))
        with served(display, onlookers.port) as server, _spelled(display, onlookers):
            onlookers.opened(server.url)
            try:
                with quietly("watching") as report:
                    found = record(link, program, shown, extent, tape, desk.due, name, report)
                server.ending = found.gone or "the watch has ended"
            except BaseException:
                server.ending = "the watch ended before the first sample came"
                raise
            finally:
                desk.close()
    # Without a time of its own it ends when somebody stops it, and so never before its time.
    return found if watch.seconds is not None else replace(found, stopped=False)


def _held(link: LiveLink, program: Program) -> dict[str, float]:
    """Return what the parameters hold now, which somebody may have set before."""
    if not program.parameters:
        return {}
    tape, names = Tape(1), tuple(parameter.name for parameter in program.parameters)
    take(link, Extent(names, 1, 1), tape, schedule(()), never, lambda share, doing: None)
    return held_of(program, tape.seen(1).rows)


@contextmanager
def _spelled(display: Display, onlookers: Onlookers) -> Iterator[None]:
    """Spell every sample beside the watch; a reader that went away does not end it."""
    spelling = onlookers.spelling
    if spelling is None:
        yield
        return

    def spell() -> None:
        with suppress(BrokenPipeError):
            for rows in display.tape.follow(0, MOST_LINES, SILENCE):
                onlookers.lines(spelling(display.channels, display.program.period, display.values(rows)))

    speller = threading.Thread(target=spell, name="firmloop lines", daemon=True)
    speller.start()
    try:
        yield
    finally:
        display.tape.close()
        speller.join()
