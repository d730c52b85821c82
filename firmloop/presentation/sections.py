"""Write what a stage found as a piece of a page: a heading, tables and figures."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from firmloop.design.roles import reference_and_measurement
from firmloop.identify.units import unit_of
from firmloop.presentation import words
from firmloop.presentation.code_words import figure, percent
from firmloop.presentation.figures import (
    CurvePair,
    Step,
    bode_figure,
    comparison_figure,
    labelled,
    search_figure,
    step_figure,
)
from firmloop.presentation.tuning_table import HEAD, contest_notes, contest_rows

if TYPE_CHECKING:
    from firmloop.design.analysis.contest import Entry
    from firmloop.design.design import Design
    from firmloop.identify.fitting.fit import Fit
    from firmloop.identify.fitting.scores import RecordingScore
    from firmloop.identify.recordings.recording import Recording
    from firmloop.stages.analysis import Loop
    from firmloop.stages.data import Data
    from firmloop.stages.making import Generated
    from firmloop.stages.tracking import Tracking
    from firmloop.stages.verification import Outcome
    from firmloop.verify.verdict import ClosedLoop

LONG = 70  # letters of a cell that is broken into lines
MOST_FIGURES = 12  # of recordings; the table holds the others


def verdict_cards(outcomes: Sequence[Outcome]) -> str:
    """One card a target."""
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


def plant_section(fit: Fit, data: Data) -> list[str]:
    """Parameters with their intervals, scores, and each recording beside its prediction."""
    scored = [("train", score) for score in fit.train] + [("test", score) for score in fit.test]
    scores = [
        (
            role,
            Path(score.source).name,
            output,
            figure(each.fit_percent, ".2f"),
            figure(each.rmse, ".3g"),
            figure(each.mae, ".3g"),
            unit_of(output) or "1",
            figure(each.r2, ".6f"),
        )
        for role, score in scored
        for output, each in score.scores.items()
    ]
    compared = comparisons(fit, data)
    more = len(compared) - MOST_FIGURES
    return [
        f"<h2>Plant: {html.escape(fit.plant.kind)}</h2>",
        page_table(
            ("parameter", "value", "95 % interval", "unit"),
            words.parameter_rows(fit.plant),
        ),
        *(
            [page_table(("recording", "value of its own", "value", "95 % interval", "unit"), own)]
            if (own := words.own_rows(fit.per_recording))
            else []
        ),
        *[f"<p>Note: {html.escape(warning)}</p>" for warning in fit.warnings],
        page_table(("", "recording", "output", "fit, %", "rmse", "mae", "unit", "R2"), scores),
        *[comparison_figure(comparison) for comparison in compared[:MOST_FIGURES]],
        *([f"<p>{more} more are in the table only.</p>"] if more > 0 else []),
    ]


def comparisons(fit: Fit, data: Data) -> list[CurvePair]:
    """Every recording beside its prediction, output by output."""
    pairs: list[tuple[str, RecordingScore, Recording]] = [
        (role, score, recording)
        for role, scores, recordings in (
            ("train", fit.train, data.train),
            ("test", fit.test, data.test),
        )
        for score, recording in zip(scores, recordings, strict=True)
    ]
    return [
        CurvePair(
            title=f"{role}: {Path(score.source).name}, fit {percent(score.scores[output.name].fit_percent, '.1f')}",
            output=output.name,
            unit=unit_of(output.name),
            time=recording.time,
            measured=recording.columns[output.name],
            simulated=score.simulated[:, index],
            inputs=tuple(
                (each.name, each.unit, recording.columns[each.name])
                for each in fit.plant.inputs
                if each.name in recording.columns
            ),
        )
        for role, score, recording in pairs
        for index, output in enumerate(fit.plant.outputs)
    ]


def controller_section(design: Design, loop: Loop | None, tracked: Tracking | None) -> list[str]:
    """Gains, the closed loop, and what a feedforward is worth."""
    step = step_of(design, loop)
    by = f"tuned by {design.tuned_by}" if design.tuned_by else "gains as given"
    gains = [(name, figure(value, ".5g")) for name, value in design.gains.items()]
    parts = [f"<h2>Controller: {html.escape(by)}</h2>", page_table(("gain", "value"), gains)]
    if loop and step:
        parts += [
            step_figure(step),
            *([bode_figure(loop.bode, loop.margins.crossover_rad_s)] if loop.bode else []),
            page_table(("figure", "value"), words.margin_rows(loop) + words.step_rows(loop)),
        ]
    return parts + (_tracking(tracked, design) if tracked else [])


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
    parts.append(page_table(("feedforward", "rms error", "worst error", "unit"), rows))
    for name, run in (("without", found.without), ("with", found.beside)):
        course = (time[shown], found.reference[shown], run.measurement[shown], run.command[shown])
        parts += [f"<p>{name} it:</p>", step_figure(Step(*course, found.unit, output.unit, limits))]
    if design.not_met:
        parts.append(page_table(("not met", "because"), list(design.not_met.items())))
    return parts


def tuning_section(tuned: Sequence[Entry]) -> list[str]:
    """Tell what other rules make of the plant."""
    if not tuned:
        return []
    refused = [f"<p>{html.escape(entry.rule)}: {html.escape(entry.refused)}</p>" for entry in tuned if entry.refused]
    notes = [f"<p>{html.escape(note.strip())}</p>" for note in contest_notes(tuned)]
    return ["<h2>Tuning rules on this plant</h2>", page_table(HEAD, contest_rows(tuned)), *notes, *refused]


def step_of(design: Design, loop: Loop | None) -> Step | None:
    """Return the closed loop's step for a figure, None where there is none."""
    if loop is None:
        return None
    law, course = design.law, loop.step
    _, measurement = reference_and_measurement(law.inputs)
    gains = design.gains
    # Long after the loop has settled nothing happens.
    settled = loop.metrics.settling_2_s
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


def code_section(generated: Generated) -> list[str]:
    """Show what was generated, and its step function."""
    program, bundle = generated.program, generated.bundle
    sizes = [(name, f"{len(text.encode()):,} bytes") for name, text in bundle.files.items()]
    return [
        "<h2>C</h2>",
        f"<p>{html.escape(program.arithmetic)}, {len(program.body)} operations, program <code>{program.id}</code></p>",
        page_table(("file", "size"), sizes),
        block("C of a step", _step_function(bundle.files[bundle.sources[0]], program.name)),
    ]


def _step_function(source: str, name: str) -> str:
    """Cut name_step() out of the C; a line of only `}` ends a function."""
    lines = source.splitlines()
    begin = next((at for at, line in enumerate(lines) if line.startswith("uint32_t") and f"{name}_step(" in line), 0)
    end = next((at for at in range(begin, len(lines)) if lines[at] == "}"), len(lines) - 1)
    return "\n".join(lines[begin : end + 1])


def targets_section(outcomes: Sequence[Outcome], design: Design) -> list[str]:
    """Each target, figure by figure."""
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
        parts.append(page_table(("figure", "value"), rows))
        if verdict.closed_loop:
            parts.append(step_figure(_target_loop(verdict.closed_loop, design)))
        if verdict.searches:
            parts.append(labelled("the steps about the one that took longest", search_figure(verdict.searches)))
        if verdict.first:
            parts.append(block("what differs", "\n".join(words.about_outcome(outcome))))
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


def block(says: str, text: str) -> str:
    """Return text as it is; what does not fit on a narrow screen can be scrolled to, by keys as well."""
    return f'<pre role="group" aria-label="{html.escape(says)}" tabindex="0">{html.escape(text)}</pre>'


def page_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table of a page."""

    def row(cells: Sequence[str]) -> str:
        first, *others = cells
        columns = [f"<td{' class=long' * (len(cell) > LONG)}>{html.escape(cell)}</td>" for cell in others]
        return f'<tr><th scope="row">{html.escape(first)}</th>{"".join(columns)}</tr>'

    titles = "".join(f'<th scope="col">{html.escape(title)}</th>' if title else "<td></td>" for title in head)
    return (
        f'<div class="scroll" role="group" aria-label="{html.escape(" ".join(filter(None, head)))}" tabindex="0">'
        f"<table><thead><tr>{titles}</tr></thead><tbody>{''.join(map(row, rows))}</tbody></table></div>"
    )
