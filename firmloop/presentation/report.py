"""Write report.html: one page without a script, the same bytes for the same walk on the same day."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING

from firmloop.presentation import words
from firmloop.presentation.figures import overview
from firmloop.presentation.page import origin, page
from firmloop.presentation.sections import (
    code_section,
    comparisons,
    controller_section,
    plant_section,
    step_of,
    targets_section,
    tuning_section,
    verdict_cards,
)

if TYPE_CHECKING:
    from firmloop.design.analysis.contest import Entry
    from firmloop.design.design import Design
    from firmloop.identify.fitting.fit import Fit
    from firmloop.project.project import Project
    from firmloop.stages.analysis import Loop
    from firmloop.stages.data import Data
    from firmloop.stages.making import Generated
    from firmloop.stages.tracking import Tracking
    from firmloop.stages.verification import Outcome


@dataclass(frozen=True, slots=True)
class Walk:
    """Everything a walk produced; `command` makes it again."""

    project: Project
    command: str
    data: Data
    fit: Fit
    design: Design
    loop: Loop | None
    generated: Generated
    outcomes: tuple[Outcome, ...]
    tuned: tuple[Entry, ...] = ()  # by other rules, beside the design
    tracking: Tracking | None = None


def report(walk: Walk) -> str:
    """Return the page."""
    made_from = origin(walk.command, walk.data, walk.outcomes)
    return page(walk.project.name, "report", walk_sections(walk), made_from)


def walk_sections(walk: Walk) -> list[str]:
    """Return what the page holds."""
    return [
        f'<h1>{html.escape(walk.project.name)}</h1><p class="says">{html.escape(walk.design.law.says)}</p>',
        verdict_cards(walk.outcomes),
        *plant_section(walk.fit, walk.data),
        *controller_section(walk.design, walk.loop, walk.tracking),
        *tuning_section(walk.tuned),
        *code_section(walk.generated),
        *targets_section(walk.outcomes, walk.design),
    ]


def picture(walk: Walk) -> str:
    """Return one SVG that shows the walk: recorded and predicted, the closed loop, and the verdicts."""
    lines = [line for outcome in walk.outcomes for line in words.about_outcome(outcome)[:1]]
    scored = len(walk.fit.train) if walk.fit.test else 0  # an unseen recording tells more, if there is one
    return overview(
        comparisons(walk.fit, walk.data)[scored * len(walk.fit.plant.outputs)], step_of(walk.design, walk.loop), lines
    )
