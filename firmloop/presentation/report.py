"""Write report.html: one page without a script, a link or a date, the same bytes for the same walk."""

from __future__ import annotations

import html
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from firmloop.presentation import words
from firmloop.presentation.figures import overview
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

STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; --good: #2a9d62; --bad: #d6452b; --idle: #b07d12; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1.2rem;
       color: #1d2126; background: #fff; }
@media (prefers-color-scheme: dark) { body { color: #d8dce2; background: #14171b; } }
h1 { font-size: 1.5rem; margin: 0; }
h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid var(--line); }
h3 { font-size: .95rem; margin: 1.4rem 0 .3rem; font-weight: 600; }
p.says { margin: .2rem 0 1rem; opacity: .8; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .6rem 0; }
th, td { text-align: left; padding: .22rem 1.1rem .22rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th { font-weight: 600; } td.figure { text-align: right; }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1.2rem 0; }
.card { border: 1px solid var(--line); border-left: .35rem solid var(--idle); border-radius: .3rem;
        padding: .5rem .9rem; min-width: 14rem; }
.card.agrees { border-left-color: var(--good); } .card.differs { border-left-color: var(--bad); }
.card b { display: block; }
pre { background: var(--soft); padding: .8rem 1rem; overflow-x: auto; font-size: 12.5px; line-height: 1.4; }
code { font-size: .92em; } svg { width: 100%; height: auto; }
""".strip()


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
    return page(walk.project.name, "report", walk_sections(walk), walk.command)


def page(name: str, what: str, sections: Iterable[str], command: str) -> str:
    """Return a page about the project called `name`, by firmloop; `command` makes it again."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(name)}: firmloop {what}</title>",
        f"<style>\n{STYLE}\n</style></head><body>",
        *sections,
        f"<h2>This report</h2><p>was made by <code>{html.escape(command)}</code></p>",
        "</body></html>",
    ]
    return "\n".join(parts) + "\n"


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
