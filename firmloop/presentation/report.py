"""Write report.html: one page without a script, a link or a date, the same bytes for the same walk."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmloop.design.analysis.contest import Entry
from firmloop.design.design import Design
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.fitting.fit import Fit, RecordingScore
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.units import unit_of
from firmloop.presentation import words
from firmloop.presentation.figures import Comparison, Step, comparison_figure, overview, search_figure, step_figure
from firmloop.project.project import Project
from firmloop.stages.pipeline import Data, Generated, Loop, Outcome
from firmloop.stages.tracking import Tracking
from firmloop.tuning import HEAD, contest_rows
from firmloop.verify.verdict import ClosedLoop

MOST_FIGURES = 12  # of recordings; the table holds the others
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
    name = html.escape(walk.project.name)
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{name}: firmloop report</title>",
        f"<style>\n{STYLE}\n</style></head><body>",
        f'<h1>{name}</h1><p class="says">{html.escape(walk.design.law.says)}</p>',
        _cards(walk.outcomes),
        *_plant(walk),
        *_controller(walk),
        *_tuning(walk.tuned),
        *_code(walk.generated),
        *_targets(walk.outcomes, walk.design),
        f"<h2>This report</h2><p>was made by <code>{html.escape(walk.command)}</code></p>",
        "</body></html>",
    ]
    return "\n".join(parts) + "\n"


def picture(walk: Walk) -> str:
    """Return one SVG that shows the walk: recorded and predicted, the closed loop, and the verdicts."""
    lines = [line for outcome in walk.outcomes for line in words.about_outcome(outcome)[:1]]
    scored = len(walk.fit.train) if walk.fit.test else 0  # an unseen recording tells more, if there is one
    return overview(_comparisons(walk)[scored * len(walk.fit.plant.outputs)], _step(walk), lines)


def _cards(outcomes: Sequence[Outcome]) -> str:
    cards = []
    for outcome in outcomes:
        verdict = outcome.verdict
        if verdict is None:
            kind, says = "idle", outcome.not_run
        else:
            kind = "agrees" if verdict.agrees else "differs"
            says = f"{verdict.steps:,} steps, {verdict.differences:,} differences"
            says = verdict.undefined.sentence() if verdict.undefined else says
        cards.append(
            f'<div class="card {kind}"><b>{html.escape(outcome.target)}: '
            f"{kind if verdict else 'not run'}</b>{html.escape(says)}</div>"
        )
    return f'<div class="cards">{"".join(cards)}</div>'


def _plant(walk: Walk) -> list[str]:
    fit = walk.fit
    scored = [("train", score) for score in fit.train] + [("test", score) for score in fit.test]
    scores = [
        (
            role,
            Path(score.source).name,
            output,
            f"{each.fit_percent:.2f}",
            f"{each.rmse:.3g}",
            f"{each.mae:.3g}",
            f"{each.r2:.6f}",
        )
        for role, score in scored
        for output, each in score.scores.items()
    ]
    comparisons = _comparisons(walk)
    more = len(comparisons) - MOST_FIGURES
    return [
        f"<h2>Plant: {html.escape(fit.plant.kind)}</h2>",
        _table(
            ("parameter", "value", "95 % interval", "unit"),
            [(p.name, *words.estimate(p)) for p in fit.plant.parameters],
        ),
        *[f"<p>Note: {html.escape(warning)}</p>" for warning in fit.warnings],
        _table(("", "recording", "output", "fit, %", "rmse", "mae", "R2"), scores),
        *[comparison_figure(comparison) for comparison in comparisons[:MOST_FIGURES]],
        *([f"<p>{more} more are in the table only.</p>"] if more > 0 else []),
    ]


def _comparisons(walk: Walk) -> list[Comparison]:
    pairs: list[tuple[str, RecordingScore, Recording]] = [
        (role, score, recording)
        for role, scores, recordings in (
            ("train", walk.fit.train, walk.data.train),
            ("test", walk.fit.test, walk.data.test),
        )
        for score, recording in zip(scores, recordings, strict=True)
    ]
    return [
        Comparison(
            title=f"{role}: {Path(score.source).name}, fit {score.scores[output.name].fit_percent:.1f} %",
            output=output.name,
            unit=unit_of(output.name),
            time=recording.time,
            measured=recording.columns[output.name],
            simulated=score.simulated[:, index],
        )
        for role, score, recording in pairs
        for index, output in enumerate(walk.fit.plant.outputs)
    ]


def _controller(walk: Walk) -> list[str]:
    design, step = walk.design, _step(walk)
    by = f"tuned by {design.tuned_by}" if design.tuned_by else "gains as given"
    gains = [(name, f"{value:.5g}") for name, value in design.gains.items()]
    parts = [f"<h2>Controller: {html.escape(by)}</h2>", _table(("gain", "value"), gains)]
    if walk.loop and step:
        parts += [
            step_figure(step),
            _table(("figure", "value"), words.margin_rows(walk.loop) + words.step_rows(walk.loop)),
        ]
    return parts + (_tracking(walk.tracking, design) if walk.tracking else [])


def _tracking(found: Tracking, design: Design) -> list[str]:
    """Show what the feedforward is worth against the plant with its effects, the C itself in the loop."""
    shown = slice(len(found.reference) // 2, None)
    rows = [
        (name, f"{run.rms:.4g}", f"{run.worst:.4g}", found.unit)
        for name, run in (("without", found.without), ("with", found.beside))
    ]
    output = design.law.outputs[0]
    limits = (design.gains.get("u_min", output.low), design.gains.get("u_max", output.high))
    time = np.arange(len(found.reference), dtype=np.float64) * found.period
    parts = ["<h3>Feedforward against the plant's effects</h3>"]
    parts.append(_table(("feedforward", "rms error", "worst error", "unit"), rows))
    for name, run in (("without", found.without), ("with", found.beside)):
        course = (time[shown], found.reference[shown], run.measurement[shown], run.command[shown])
        parts += [f"<p>{name} it:</p>", step_figure(Step(*course, found.unit, output.unit, limits))]
    if design.not_met:
        parts.append(_table(("not met", "because"), list(design.not_met.items())))
    return parts


def _tuning(tuned: Sequence[Entry]) -> list[str]:
    if not tuned:
        return []
    refused = [f"<p>{html.escape(entry.rule)}: {html.escape(entry.refused)}</p>" for entry in tuned if entry.refused]
    return ["<h2>Tuning rules on this plant</h2>", _table(HEAD, contest_rows(tuned)), *refused]


def _step(walk: Walk) -> Step | None:
    if walk.loop is None:
        return None
    law, course = walk.design.law, walk.loop.step
    _, measurement = reference_and_measurement(law.inputs)
    gains = walk.design.gains
    # Long after the loop has settled nothing happens.
    settled = walk.loop.metrics.settling_2_s
    shown = slice(0, int(3 * settled / law.period) + 2 if math.isfinite(settled) else None)
    limits = (gains.get("u_min", law.outputs[0].low), gains.get("u_max", law.outputs[0].high))
    return Step(
        course.time[shown],
        course.reference[shown],
        course.measurement[shown],
        course.output[shown],
        law.inputs[measurement].unit,
        law.outputs[0].unit,
        limits,
    )


def _code(generated: Generated) -> list[str]:
    program, bundle = generated.program, generated.bundle
    sizes = [(name, f"{len(text.encode()):,} bytes") for name, text in bundle.files.items()]
    return [
        "<h2>C</h2>",
        f"<p>{html.escape(program.arithmetic)}, {len(program.body)} operations, program <code>{program.id}</code></p>",
        _table(("file", "size"), sizes),
        f"<pre>{html.escape(_step_function(bundle.files[bundle.sources[0]], program.name))}</pre>",
    ]


def _step_function(source: str, name: str) -> str:
    """Cut name_step() out of the C; a line of only `}` ends a function."""
    lines = source.splitlines()
    begin = next((at for at, line in enumerate(lines) if line.startswith("uint32_t") and f"{name}_step(" in line), 0)
    end = next((at for at in range(begin, len(lines)) if lines[at] == "}"), len(lines) - 1)
    return "\n".join(lines[begin : end + 1])


def _targets(outcomes: Sequence[Outcome], design: Design) -> list[str]:
    parts = ["<h2>C against the bit-exact reference</h2>"]
    for outcome in outcomes:
        parts.append(f"<h3>{html.escape(outcome.target)}</h3>")
        verdict = outcome.verdict
        if verdict is None:
            parts.append(f"<p>Not run: {html.escape(outcome.not_run)}</p>")
            continue
        rows = [
            ("verdict", words.verdict_word(verdict)),
            (
                "steps",
                f"{verdict.steps:,}, of them {', '.join(f'{n:,} {name}' for name, n in verdict.stimuli.items())}",
            ),
            ("differences", f"{verdict.differences:,}"),
            *words.sanitizer_rows(verdict),
            *words.rounding_rows(verdict),
            *words.cost_rows(verdict),
            *words.search_rows(verdict),
            *words.loop_rows(verdict),
            ("compiler", f"{verdict.compiler} {' '.join(verdict.flags)}"),
            ("seed", str(verdict.seed)),
        ]
        parts.append(_table(("figure", "value"), rows))
        if verdict.closed_loop:
            parts.append(step_figure(_target_loop(verdict.closed_loop, design)))
        if verdict.searches:
            parts.append(search_figure(verdict.searches))
        if verdict.first:
            parts.append(f"<pre>{html.escape(chr(10).join(words.about_outcome(outcome)))}</pre>")
    return parts


def _target_loop(loop: ClosedLoop, design: Design) -> Step:
    """Return the run of the target's controller against the plant, for a figure."""
    law = design.law
    _, measurement = reference_and_measurement(law.inputs)
    output = law.outputs[0]
    return Step(
        np.arange(loop.steps, dtype=np.float64) * law.period,
        np.asarray(loop.reference),
        np.asarray(loop.measurement),
        np.asarray(loop.command),
        law.inputs[measurement].unit,
        output.unit,
        (design.gains.get("u_min", output.low), design.gains.get("u_max", output.high)),
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return f"<table>{row(head, 'th')}{''.join(row(cells, 'td') for cells in rows)}</table>"
