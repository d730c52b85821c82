"""Write the report of a diagnosis: one page without a script."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.discrepancy.disturbance import balance_unit
from firmloop.diagnose.discrepancy.locate import nominal_plant
from firmloop.diagnose.model.disturbance_smoother import Latent, latent
from firmloop.diagnose.model.fit import fit_starts
from firmloop.diagnose.model.hypothesis import outputs_of
from firmloop.diagnose.model.slopes import residual_of
from firmloop.diagnose.plant_words import balance_told, missing_told
from firmloop.diagnose.policy import IMPOSSIBLE
from firmloop.identify.normal import NORMAL_95
from firmloop.presentation.code_words import figure, percent
from firmloop.presentation.figures import DATA, DRIVE, LIMIT, MODEL, dots, labelled, styled, svg, thinned
from firmloop.presentation.page import origin, page
from firmloop.presentation.sections import page_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from firmloop.diagnose.controller.replay import Cut
    from firmloop.diagnose.discrepancy.fit import Shape
    from firmloop.diagnose.finding import Finding, Shift
    from firmloop.diagnose.model.hypothesis import LibraryTerm
    from firmloop.diagnose.run import Diagnosis
    from firmloop.diagnose.search.found import Search
    from firmloop.identify.plants.plant import Plant
    from firmloop.identify.signal import Signal
    from firmloop.stages.data import Data

Array = NDArray[np.float64]

_COLUMNS = 500
NO_GAIN = "none: a value at the end of its range, or a recording that it cannot simulate"
_DOTS = 1200  # of a scatter


def diagnosis_report(name: str, command: str, data: Data, made: Diagnosis, cut: Cut | None) -> str:
    """Return the page; `cut` is what the replay of the controller says, None where there was nothing to replay."""
    title = f"<h1>{html.escape(name)}: {html.escape(made.finding.verdict.replace('_', ' '))}</h1>"
    return page(name, "diagnosis", [title, *diagnosis_sections(made, cut)], origin(command, data, ()))


def diagnosis_sections(made: Diagnosis, cut: Cut | None) -> list[str]:
    """Return what the page holds below its title."""
    finding = made.finding
    return [
        *(f"<p>{html.escape(line)}</p>" for line in finding.says),
        *effects_table(finding),
        "<h2>Recording against model</h2>",
        *_courses(made),
        "<h2>What is left, by coordinate</h2>",
        *_scatter(made),
        *_unnamed(made.finding, made.search.problem.plant),
        "<h2>How sure, and how much is still missing</h2>",
        *evidence_tables(finding, made.search.problem.plant),
        "<h2>The controller half</h2>",
        *controller_tables(cut),
        "<h2>What was weighed</h2>",
        ranking_table(made.search),
        "<h2>Parameters</h2>",
        shifts_table(finding.shifts),
        *_untestable(finding, made),
    ]


def shifts_table(shifts: Sequence[Shift]) -> str:
    """Nominal parameters as given, refitted alone, and beside the effects."""
    rows = [(s.name, *(figure(value, ".5g") for value in (s.given, s.refit, s.after)), s.unit) for s in shifts]
    return page_table(("parameter", "given", "refitted alone", "with the effects", "unit"), rows)


def effects_table(finding: Finding) -> list[str]:
    """Return what was left out, with its parameters."""
    rows = [
        (
            each.name,
            each.output or each.at,
            percent(100.0 * each.probability, ".0f"),
            key,
            figure(estimate.value, ".5g"),
            "" if estimate.interval is None else " to ".join(figure(end, ".4g") for end in estimate.interval),
            estimate.unit,
        )
        for each in finding.effects
        for key, estimate in each.parameters.items()
    ]
    head = ("effect", "acts at", "probability", "parameter", "value", "95 % interval", "unit")
    return ["<h2>Left out</h2>", page_table(head, rows)] if rows else []


def evidence_tables(finding: Finding, plant: Plant) -> list[str]:
    """Return the evidence, the disturbances that what is left amounts to, and the misses of free simulations."""
    parts, found = [], finding.evidence
    if found is not None:
        chance = "cannot be told" if found.p_value is None else figure(found.p_value, ".2g")
        row = (found.criterion, figure(found.gain, ".1f"), str(found.library), chance)
        parts.append(page_table(("criterion", "drop", "terms tried", "by chance with a probability of"), [row]))
    rows = [
        (
            balance_told(plant, name).removesuffix(" balance"),
            figure(each.rms, ".3g"),
            each.unit,
            "" if each.share is None else percent(100.0 * each.share, ".2g"),
        )
        for name, each in finding.disturbance.items()
    ]
    if rows:
        parts.append(page_table(("balance", "disturbance that is left, rms", "unit", "of the drive"), rows))
    keys = ("before", "refit", "after")
    missed = [
        (role, name, *(figure(rms[key], ".4g") if key in rms else "" for key in keys), _noise(finding, name))
        for role, outputs in finding.simulation_rms.items()
        for name, rms in outputs.items()
    ]
    head = ("recordings", "output", "rms missed as given", "refitted", "explained", "noise of the sensor")
    return [*parts, page_table(head, missed)] if missed else parts


def _noise(finding: Finding, output: str) -> str:
    return figure(finding.noise[output], ".4g") if output in finding.noise else ""


def _courses(made: Diagnosis) -> list[str]:
    """Draw the first train recording and, where there is one, the first test recording."""
    problem, shown = made.search.problem, made.shown
    given = {p.name: p.value for p in problem.plant.parameters}
    drawn = []
    for role, recordings in (("train", problem.train[:1]), ("test", problem.test[:1])):
        for recording in recordings:
            measured = outputs_of(problem, recording)
            runs = []
            for values in (given, made.search.nominal.fitted.point.values, shown.fitted.point.values):
                point = fit_starts(problem, [recording], values, made.search.best.noises)
                runs.append(measured - residual_of(problem, recording, point, 0))
            if made.shape is not None and role == "train":
                runs[-1] = measured - made.shape.residuals[0]
            for index, signal in enumerate(problem.plant.outputs):
                title = f"{role}: {Path(recording.source).name}, {signal.name}"
                course = [run[:, index] for run in runs]
                inputs = [(each, recording.columns[each.name]) for each in problem.plant.inputs]
                drawn.append(_course(title, signal.unit, recording.time, measured[:, index], course, inputs))
    return drawn


def _course(
    title: str, unit: str, time: Array, measured: Array, runs: Sequence[Array], inputs: Sequence[tuple[Signal, Array]]
) -> str:
    """Draw the recording and the runs, what they leave, and the inputs."""
    with styled(8.6, 3.6 + 0.9 * len(inputs)) as figure:
        ratios = (3, 2, *[1] * len(inputs))
        above, below, *drives = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios, squeeze=True)
        above.plot(*thinned(time, measured, _COLUMNS), color=DATA, linewidth=1.9, label="recorded")
        names, colors = ("as given", "refitted", "explained"), (LIMIT, MODEL, DRIVE)
        for run, name, color in zip(runs, names, colors, strict=True):
            if np.all(np.isfinite(run)):
                above.plot(*thinned(time, run, _COLUMNS), color=color, linewidth=0.9, label=name)
                below.plot(*thinned(time, measured - run, _COLUMNS), color=color, linewidth=0.8)
        # As given may miss by so much that nothing else could be seen.
        sound = [run for run in runs[1:] if np.all(np.isfinite(run))]
        if sound and (most := max(float(np.max(np.abs(measured - run))) for run in sound)) > 0.0:
            below.set_ylim(-1.5 * most, 1.5 * most)
        low, high = (float(end) for end in np.percentile(np.concatenate([measured, *sound]), (0.0, 100.0)))
        if high > low:
            above.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))
        for axes, (signal, values) in zip(drives, inputs, strict=True):
            axes.plot(*thinned(time, values, _COLUMNS), color=DRIVE, linewidth=0.9)
            axes.set_ylabel(f"{signal.name}\n{signal.unit or '1'}")
        above.set_title(title)
        above.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=4, borderaxespad=0.0)
        above.set_ylabel(unit or "1")
        below.set_ylabel(f"residual\n{unit or '1'}")
        figure.axes[-1].set_xlabel("time, s")
        figure.align_ylabels()
        return labelled(title, svg(figure))


def _scatter(made: Diagnosis) -> list[str]:
    """Draw the latent torque or voltage of the nominal plant over every coordinate that may carry it.

    Over it what the same smoother sees where the explanation has made the outputs: the fitted law, without noise.
    """
    problem, shown = made.search.problem, made.shown
    plant = nominal_plant(made.search, shown)
    recording = problem.train[0]
    seen = latent(plant, recording, [noise.rms for noise in made.search.best.noises])
    if seen is None:
        return ["<p>The equations of this plant have no balance in which something could be missing.</p>"]
    law = _explained(made, plant) if shown.fitted.terms else None
    with styled(8.6, 2.6 * len(seen.kinds)) as figure:
        count = len(plant.states)
        every = figure.subplots(len(seen.kinds), count, squeeze=False)
        pick = np.linspace(0, len(seen.time) - 1, min(_DOTS, len(seen.time))).astype(int)
        for row, kind in enumerate(seen.kinds):
            for column, signal in enumerate(plant.states):
                axes = every[row][column]
                dots(axes, seen.states[pick, column], seen.disturbances[row][pick], DATA)
                if law is not None:
                    dots(axes, law.states[pick, column], law.disturbances[row][pick], MODEL)
                _law(axes, made.shape, kind, signal.name)
                axes.set_xlabel(f"{signal.name}, {signal.unit or '1'}")
                axes.set_ylabel(_missing(plant, kind))
        figure.tight_layout()
        says = "dots: recorded" + ("; in the other colour: the explanation" if law is not None else "")
        return [
            labelled("what the nominal equations leave unexplained", svg(figure)),
            f"<p>What the nominal equations with the parameters found leave unexplained ({says}).</p>",
        ]


def _missing(plant: Plant, kind: str) -> str:
    """Name what is missing from a balance of a kind, with its unit; of a sensor there is none."""
    unit = next((balance_unit(plant, each) for each in plant.balances if each.kind == kind), "")
    return f"{missing_told(plant, kind)}, {unit}" if unit else missing_told(plant, kind)


def _unnamed(finding: Finding, plant: Plant) -> list[str]:
    """Draw the law of what has no name over its own coordinate, which need not be a state."""
    if finding.location is None or not finding.law:
        return []
    with styled(5.2, 2.6) as figure:
        axes = figure.subplots()
        axes.plot(*np.array(finding.law).T, color=MODEL)
        axes.set_xlabel(finding.location.coordinate)
        axes.set_ylabel(_missing(plant, finding.location.equation))
        figure.tight_layout()
        return [
            labelled("the law of what has no name", svg(figure)),
            "<p>What has no name in the library, as the recordings show it (SI units).</p>",
        ]


def _explained(made: Diagnosis, plant: Plant) -> Latent | None:
    """See the outputs that the explanation simulates as the nominal plant sees the recorded ones."""
    problem, recording = made.search.problem, made.search.problem.train[0]
    point = fit_starts(problem, [recording], made.shown.fitted.point.values, made.search.best.noises)
    simulated = outputs_of(problem, recording) - residual_of(problem, recording, point, 0)
    if not np.all(np.isfinite(simulated)):
        return None
    columns = {signal.name: simulated[:, index] for index, signal in enumerate(problem.plant.outputs)}
    shown = replace(recording, columns={**recording.columns, **columns})
    return latent(plant, shown, [noise.rms for noise in made.search.best.noises])


def controller_tables(cut: Cut | None) -> list[str]:
    """Say what the replay of the controller on its recorded inputs showed."""
    if cut is None or cut.samples == 0:
        notes = "" if cut is None else " ".join(f"{note}." for note in cut.notes)
        return [
            "<p>Not replayed: that takes a [controller] in the project, and its reference and command in the "
            f"recordings. {html.escape(notes)}</p>"
        ]
    rows = [
        ("recordings replayed", f"{cut.loops}"),
        ("samples", f"{cut.samples:,}"),
        ("answered as recorded, within its digits", f"{cut.same:,}"),
        ("largest difference", f"{figure(cut.worst, '.4g')} {cut.unit}"),
    ]
    faults = [
        (role, each.fault.name, each.fault.what, figure(each.figure, ".5g"), _reach(each.deviation), each.fault.unit)
        for role, blames in (("explains it", cut.blames), ("would as well", cut.others))
        for each in blames
    ]
    parts = [page_table(("figure", "value"), rows)]
    if faults:
        parts.append(page_table(("", "fault", "of", "figure", "95 %", "unit"), faults))
    elif cut.unexplained:
        parts.append("<p>No single gain, limit, delay, period or sign explains the difference.</p>")
    return parts


def _reach(deviation: float | None) -> str:
    half = math.nan if deviation is None else NORMAL_95 * deviation
    return f"± {half:.2g}" if math.isfinite(half) else ""


def _law(axes: Axes, shape: Shape | None, kind: str, coordinate: str) -> None:
    if shape is not None and shape.balance == kind and shape.coordinate == coordinate:
        axes.plot(shape.points[:, 0], shape.points[:, 1], color=MODEL)


def ranking_table(search: Search) -> str:
    """Return every explanation that was weighed, round by round."""
    rows = []
    for turn, candidates in enumerate(search.rounds):
        for candidate in candidates:
            names = " + ".join(_placed(search, term) for term in candidate.fitted.terms)
            cannot = candidate.score > 0.5 * IMPOSSIBLE
            gain = NO_GAIN if cannot else figure(search.nominal.score - candidate.score, ".1f")
            rows.append((str(turn + 1), names, gain))
    return page_table(("round", "explanation", "drop of BIC against the refitted nominal plant"), rows)


def _placed(search: Search, term: LibraryTerm) -> str:
    """Name an effect and its place, the first one too where there is a choice."""
    place = term.place_told(search.problem.plant)
    return term.label if place is None else f"{term.effect.name} of {place}"


def _untestable(finding: Finding, made: Diagnosis) -> list[str]:
    if not finding.untestable:
        return []
    rows = []
    for name, why in sorted(finding.untestable.items()):
        term = made.search.problem.term(name)
        rows.append((name, why, term.effect.experiment if term is not None else ""))
    return [
        "<h2>What these recordings cannot test</h2>",
        page_table(("effect", "because", "the experiment that would"), rows),
    ]
