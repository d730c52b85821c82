"""Tell each noun of a walk as soon as it is there, and how the walk ended."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from firmloop.console import Console, complain
from firmloop.door.design import Designed
from firmloop.door.generate import Code
from firmloop.door.identify import Identified
from firmloop.presentation import words
from firmloop.presentation.documents import outcomes_document
from firmloop.presentation.monitor_words import about_watched, watch_document
from firmloop.presentation.telling import tell_code, tell_design, tell_fit
from firmloop.stages.board.monitoring import Watched
from firmloop.stages.tracking import Tracking
from firmloop.stages.verification import Outcome

AGREES, DIFFERS, NO_TOOL, STOPPED = 0, 1, 3, 130


def tell_noun(console: Console, noun: object) -> None:
    """Tell a noun that `verify` or `run` hands out on its way."""
    match noun:
        case Identified():
            tell_fit(console, noun.fit)
        case Designed():
            tell_design(console, noun.design, noun.loop)
        case Code():
            tell_code(console, noun.generated, noun.design.law.safe)
            if noun.unstable:
                console.lines([words.UNSTABLE_LOOP])
            if noun.not_judged:
                console.lines([f"{words.NOT_JUDGED}{noun.not_judged}"])
        case Tracking():
            console.lines(words.about_tracking(noun))
            console.result("tracking", noun.as_dict())
        case Outcome():
            console.lines(words.about_outcome(noun))


def tell_end(console: Console, outcomes: Sequence[Outcome], not_tracked: str) -> int:
    """Tell what was not run; return the exit status, for which a difference counts more than a target not there."""
    console.result("verdicts", outcomes_document(outcomes))
    if not_tracked:
        complain(f"the tracking of the feedforward was not run: {not_tracked}")
    for outcome in outcomes:
        if outcome.not_run:
            complain(f"{outcome.target} was not run: {outcome.not_run}")
    unchecked = {o.verdict.sanitizers_not_run for o in outcomes if o.verdict} - {""}
    for why in unchecked:
        complain(f"the sanitizers were not run: {why}")
    if any(outcome.verdict and not outcome.verdict.agrees for outcome in outcomes):
        return DIFFERS
    return NO_TOOL if unchecked or any(outcome.not_run for outcome in outcomes) else AGREES


def tell_watched(console: Console, found: Watched, every: int, file: Path) -> int:
    """Tell what was seen of a running controller; return the exit status, which tells that it ended before its time."""
    console.lines([*about_watched(found, every), f"written: {file}"])
    for key, value in watch_document(found).items():
        console.result(key, value)
    console.result("written", [str(file)])
    if found.gone:
        complain(f"{found.gone}; {file} holds what came before")
        return NO_TOOL
    if found.stopped:
        complain(f"stopped; {file} holds what came before")
        return STOPPED
    return AGREES
