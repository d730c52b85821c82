"""A Pool: something that does the same work for many tasks, in any order, and loses none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from firmloop.identify.extras import ToolError
from firmloop.stages.fleet.member import FleetTask, Member

Work = Callable[[FleetTask], Member]


@dataclass(frozen=True, slots=True)
class Failed:
    """Why a task has no result, though nothing is wrong with its recording."""

    says: str


Answer = Member | Failed
Pool = Callable[[Work, Iterable[FleetTask]], Iterator[tuple[FleetTask, Answer]]]


def answered(work: Work, task: FleetTask) -> Member | Failed | ToolError:
    """Do the work; what goes wrong is an answer too, so that it reaches the one who asked."""
    try:
        return work(task)
    except ToolError as error:
        return error
    except MemoryError:
        return Failed("memory ran out; give fewer --workers")
    except Exception as error:
        words = " ".join(str(error).split())[:200]
        return Failed(f"internal error: {type(error).__name__}: {words}; please report it")


def passed_on(answer: Answer | ToolError) -> Answer:
    """Return an answer; a tool that is missing is missing for all, and ends the work.

    Raises
    ------
    ToolError
        when that is the answer.
    """
    if isinstance(answer, ToolError):
        raise answer
    return answer
