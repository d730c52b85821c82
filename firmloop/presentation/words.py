"""Say results in words: nouns to lines of text, with units, and no more digits than are known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop.console import table
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.attach import told_names
from firmloop.presentation.code_words import figure, in_unit, percent, quantity

if TYPE_CHECKING:
    from firmloop.design.analysis.loop import Margins
    from firmloop.design.analysis.step_metrics import StepMetrics
    from firmloop.design.design import Design
    from firmloop.identify.fitting.fit import Fit
    from firmloop.identify.fitting.own_values import OwnValue
    from firmloop.identify.plants.plant import Parameter, Plant
    from firmloop.stages.analysis import Loop
    from firmloop.stages.reachable import Beyond
    from firmloop.stages.tracking import Tracking
    from firmloop.stages.verification import Outcome
    from firmloop.verify.verdict import Verdict

UNREACHED = "reference not reached"
NO_LIMIT, NOT_REACHED = "no limit", "not reached"  # what it means where a margin, or a time, is infinite
UNSTABLE_LOOP = (
    "  note: the loop of this controller around [plant] is UNSTABLE; `firmloop design` tells its margins: correct the "
    "gains or the plant before it drives anything"
)
NOT_JUDGED = "  note: whether the loop of this controller around [plant] is stable cannot be told: "
MARGINS = (
    ("gain margin", "gain_margin_db", "dB"),
    ("phase margin", "phase_margin_deg", "deg"),
    ("delay margin", "delay_margin_s", "s"),
    ("sensitivity peak", "sensitivity_peak", ""),
    ("crossover", "crossover_rad_s", "rad/s"),
)
METRICS = (
    ("rise time 10-90 %", "rise_s", "s"),
    ("settling time 2 %", "settling_2_s", "s"),
    ("overshoot", "overshoot_percent", "%"),
)

__all__ = ["in_unit", "quantity"]  # besides what is defined here


def about_fit(fit: Fit) -> list[str]:
    """Parameters with their 95 % intervals, and how well each recording is predicted."""
    rows = parameter_rows(fit.plant)
    scores = [
        (
            f"{role} {Path(score.source).name}",
            output,
            f"fit {percent(figures.fit_percent, '.1f')}",
            f"rmse {figure(figures.rmse, '.3g')}",
        )
        for role, scored in (("train", fit.train), ("test", fit.test))
        for score in scored
        for output, figures in score.scores.items()
    ]
    warnings = [f"  note: {warning}" for warning in fit.warnings]
    own = table(own_rows(fit.per_recording))
    told = ["  of each recording:", *own] if own else []
    begun = "  simulated from the input alone, from the start that fits best:"
    return [f"plant: {fit.plant.kind}, 95 % intervals", *table(rows), *told, begun, *table(scores), *warnings]


def parameter_rows(plant: Plant) -> list[tuple[str, str, str, str]]:
    """Tell every parameter: name, value, 95 % interval, unit."""
    means, told = {one.parameter for one in plant.varying}, told_names(plant)
    return [(told[p.name], *(_mean(p) if p.name in means else estimate(p))) for p in plant.parameters]


def _mean(parameter: Parameter) -> tuple[str, str, str]:
    return figure(parameter.value, ".4g"), "mean of train", parameter.unit


def own_rows(values: Sequence[OwnValue]) -> list[tuple[str, str, str, str, str]]:
    """Tell what each recording has of its own: recording, name, value, 95 % interval, unit."""
    return [(Path(one.source).name, one.parameter.name, *estimate(replace(one.parameter, free=True))) for one in values]


def estimate(parameter: Parameter) -> tuple[str, str, str]:
    """Value, 95 % interval and unit of a parameter, rounded to what the interval tells."""
    if not parameter.free:
        return figure(parameter.value, ".6g"), "given", parameter.unit
    half = math.nan if parameter.deviation is None else NORMAL_95 * parameter.deviation
    if not math.isfinite(half) or half == 0 or not math.isfinite(parameter.value):
        return figure(parameter.value, "#.2g").rstrip("."), "interval unknown", parameter.unit
    return rounded_to(parameter.value, half), f"± {half:.2g}", parameter.unit


def rounded_to(value: float, half: float) -> str:
    """Write a value down to the second digit of the half width of its interval, and no shorter than two digits.

    Where the interval is wider than the value, it says so itself: a value that is not 0 is what the project is given.
    """
    if value == 0 or not math.isfinite(value):
        return figure(value, "g")
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(half)) + 2
    return f"{value:#.{min(max(digits, 2), 12)}g}".rstrip(".").replace(".e", "e")


def about_design(design: Design) -> list[str]:
    """Gains and where they come from."""
    by = f"tuned by {design.tuned_by}" if design.tuned_by else "gains as given"
    gains = ", ".join(f"{name} {value + 0.0:.4g}" for name, value in design.gains.items())
    missed = [f"  not met by the feedforward: {name}; {why}" for name, why in design.not_met.items()]
    return [f"controller: {design.law.says}, {by}", f"  {gains}", *missed]


def about_tracking(found: Tracking) -> list[str]:
    """How well the C follows a wave against the plant with its effects, without and with the feedforward."""
    rows = [
        (f"  {name} feedforward", f"rms {in_unit(f'{run.rms:.3g}', found.unit)}", f"worst {run.worst:.3g}")
        for name, run in (("without", found.without), ("with", found.beside))
    ]
    return ["tracking error of the C against the plant with its effects:", *table(rows)]


def about_loop(loop: Loop) -> list[str]:
    """Margins and step metrics, no digits that the plant's intervals do not hold."""
    note = ["  note: ± from the plant's 95 % intervals, each parameter for itself"] if loop.halves else []
    rows = [(name, value) for name, value in (*margin_rows(loop), *step_rows(loop))]
    note += [f"  note: {loop.near_rest}"] if loop.near_rest else []
    return (
        table(rows)
        + _about_unstable(loop.margins)
        + note
        + _about_the_rate(loop)
        + about_reach(loop.beyond)
        + _about_points(loop)
    )


def _about_unstable(found: Margins) -> list[str]:
    """Say what makes an unstable loop stable: a smaller or a greater gain, or its other sign."""
    if found.stable:
        return []
    factor = 10.0 ** (found.gain_margin_db / 20.0)
    if math.isfinite(factor) and factor > 0.0:
        side = "below" if factor < 1.0 else "above"
        return [
            f"  note: the loop is stable with its gain {side} {factor:.3g} times what it is: scale all gains of the "
            "controller alike; of a transfer function that is the numerator, of a state space C and D"
        ]
    if found.stable_turned:
        return [
            "  note: no smaller or greater gain makes it stable, the other sign does: turn the sign of the gains, or "
            "check that of the plant's gain"
        ]
    return ["  note: no smaller or greater gain makes it stable: change the ratio of its terms, or the plant"]


def about_reach(found: Beyond | None) -> list[str]:
    """Say so where the reference's range is wider than what the actuator can hold."""
    if found is None:
        return []
    asked, drive = found.reference, found.output
    return [
        f"  note: {asked.name} may be {asked.low:.4g} to {in_unit(f'{asked.high:.4g}', asked.unit)}, and {drive.name} "
        f"from {drive.low:.4g} to {in_unit(f'{drive.high:.4g}', drive.unit)} holds the plant at {found.low:.4g} to "
        f"{in_unit(f'{found.high:.4g}', asked.unit)} at rest: what is asked beyond that is never reached; narrow "
        f"signals.{asked.name}, or check the plant's gain and its level of rest"
    ]


def _about_the_rate(loop: Loop) -> list[str]:
    """Say so where a step rests later than it is followed, as with a controller far too fast for its plant."""
    samples, period = len(loop.step.time), float(loop.step.time[1])
    if loop.to_rest <= samples * period:
        return []
    return [
        f"  note: the step is followed for {samples:,} samples, {samples * period:.3g} s, and rests only after "
        f"{loop.to_rest:.3g} s: period_s = {period:g} is very short for this loop, and {loop.to_rest / samples:.2g} "
        "would show all of it"
    ]


def _about_points(loop: Loop) -> list[str]:
    """Margins at every operating point, where there are several."""
    rows = [
        (
            says,
            "stable" if found.stable else "UNSTABLE",
            f"gain margin {quantity(found.gain_margin_db, 'dB')}",
            f"phase margin {quantity(found.phase_margin_deg, 'deg')}",
            f"Ms {quantity(found.sensitivity_peak, '')}",
        )
        for says, found in loop.points
    ]
    return ["  at each operating point, with the plant as it is there", *table(rows)] if rows else []


def margin_rows(loop: Loop) -> list[tuple[str, str]]:
    """Margins, each with its unit and, where the plant has intervals, with its own."""
    return [
        ("closed loop", "stable" if loop.margins.stable else "UNSTABLE"),
        *_figure_rows(loop, loop.margins, MARGINS, NO_LIMIT if loop.margins.stable else NOT_REACHED),
    ]


def step_rows(loop: Loop) -> list[tuple[str, str]]:
    """Step metrics, likewise; where it ends elsewhere than it was asked to, what comes of it instead."""
    step, figures = loop.step, _figure_rows(loop, loop.metrics, METRICS, NOT_REACHED)
    rests = math.isfinite(loop.metrics.settling_2_s) and loop.to_rest <= len(step.time) * float(step.time[1])
    if not loop.margins.stable or not (step.held_back or (step.off and rests)):
        return figures
    came, asked = float(step.measurement[-1]), float(step.reference[-1])
    short = short_of(came, asked) if step.held_back else f"{came:.3g} of {asked:.3g}, where this loop rests"
    return [(UNREACHED, f"{short}; the figures below are of what comes"), *figures]


def short_of(came: float, asked: float, unit: str = "") -> str:
    """Tell how far a step has come where the output's limit ends it."""
    return f"{came:.3g} of {in_unit(f'{asked:.3g}', unit)}, the output at its limit"


def _figure_rows(
    loop: Loop, noun: Margins | StepMetrics, rows: Sequence[tuple[str, str, str]], endless: str
) -> list[tuple[str, str]]:
    return [
        (says, _unsure(getattr(noun, name), loop.halves.get(name, 0.0), unit, endless)) for says, name, unit in rows
    ]


def no_finer(value: float, half: float, unit: str, endless: str) -> str:
    """Write a figure to three digits, or to fewer where the half width of its interval ends before."""
    if not 0.0 < half < math.inf or not math.isfinite(value) or value == 0.0:
        return quantity(value, unit, endless)
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(half)) + 2
    return in_unit(f"{value:.{min(max(digits, 1), 3)}g}", unit)


def _unsure(value: float, half: float, unit: str, endless: str) -> str:
    if not half > 0.0 or not math.isfinite(value):
        return quantity(value, unit, endless)
    if math.isinf(half):
        return f"{quantity(value, unit)}, not bounded within the plant's intervals"
    return in_unit(f"{rounded_to(value, half)} ± {half:.2g}", unit)


def about_outcome(outcome: Outcome) -> list[str]:
    """Verdict of one target; the first difference if there is one."""
    verdict = outcome.verdict
    if verdict is None:
        return [f"{outcome.target}: NOT RUN: {outcome.not_run}"]
    lines = [f"{verdict.target}: {verdict.steps:,} steps, {verdict.differences:,} differences: {verdict_word(verdict)}"]
    rows = sanitizer_rows(verdict) + cost_rows(verdict) + search_rows(verdict) + loop_rows(verdict)
    lines += table(rows + rounding_rows(verdict))
    first = verdict.first
    if verdict.undefined and first:
        lines += [f"  at step {first.step} ({first.lane}) on this machine; such C is not run on any target"]
    elif first:
        where = f"  first at step {first.step} ({first.lane}): {first.output}"
        lines += [
            f"{where} is {_exactly(first.got)}, expected {in_unit(_exactly(first.expected), first.unit)}",
            f"  {first.operation}",
        ]
    return lines


def _exactly(value: float) -> str:
    """Say a value of the C to all its digits, and in words where it is none."""
    if math.isfinite(value):
        return f"{value:.9g}"
    return "no number" if math.isnan(value) else f"{'below' if value < 0 else 'above'} all numbers"


def verdict_word(verdict: Verdict) -> str:
    """One word."""
    return "agrees" if verdict.agrees else "DIFFERS"


def sanitizer_rows(verdict: Verdict) -> list[tuple[str, str]]:
    """Say what the sanitizers made of the C on this machine."""
    if verdict.undefined:
        return [("sanitizers", verdict.undefined.sentence())]
    if verdict.sanitizers_not_run:
        return [("sanitizers", f"NOT RUN: {verdict.sanitizers_not_run.splitlines()[0]}")]
    return [("sanitizers", f"{verdict.sanitized:,} steps on this machine, nothing found")]


def cost_rows(verdict: Verdict) -> list[tuple[str, str]]:
    """List what one step costs, as far as it was measured."""
    cost = verdict.cost
    rows = []
    if cost.instructions_max is not None and cost.instructions_mean is not None:
        text = f"{cost.instructions_max:.0f} at most, {cost.instructions_mean:.1f} on average"
        rows.append(("instructions per step", text))
    if cost.cycles_max is not None and cost.cycles_mean is not None:
        rows.append(("cycles per step", f"{cost.cycles_max} at most, {cost.cycles_mean:.1f} on average"))
    sizes = [
        f"{name} {size}"
        for name, size in (("text", cost.text_bytes), ("data", cost.data_bytes), ("bss", cost.bss_bytes))
        if size is not None
    ]
    if sizes:
        rows.append(("bytes", ", ".join(sizes)))
    if cost.stack_bytes is not None:
        rows.append(("stack", f"{cost.stack_bytes} bytes"))
    return rows


def search_rows(verdict: Verdict) -> list[tuple[str, str]]:
    """How much work the searches took, where there were any, and what their budget bounds."""
    found, worst = verdict.searches, verdict.cost.instructions_max
    if found is None or worst is None:
        return []
    share = f"{found.instructions_bound / worst:.2f} of the worst seen"
    without = f"{found.capped:,} cut short, {found.infeasible:,} with no moves that keep every limit"
    return [
        ("search", f"work {found.work_max:,} at most, cut short at {found.budget:,}"),
        ("bound of a step", f"{found.instructions_bound:,} instructions with the whole budget taken, {share}"),
        ("steps without answer", f"{without}; {found.within:,} of them with every input in its range"),
    ]


def loop_rows(verdict: Verdict) -> list[tuple[str, str]]:
    """How the run against the plant went, where there was one."""
    loop = verdict.closed_loop
    if loop is None:
        return []
    same = "the same bits as on the host" if not loop.differences else f"{loop.differences:,} NOT as on the host"
    return [("closed loop", f"{loop.steps:,} steps against {loop.against}, {same}")]


def rounding_rows(verdict: Verdict) -> list[tuple[str, str]]:
    """How far the exact arithmetic stands from the law, in the units of the outputs."""
    return [
        (
            f"rounding of {entry.output}",
            (f"worst {in_unit(f'{entry.worst:.2g}', entry.unit)}, " if math.isfinite(entry.worst) else "no worst, ")
            + (f"bound {in_unit(f'{entry.bound:.2g}', entry.unit)}" if math.isfinite(entry.bound) else "no bound"),
        )
        for entry in verdict.rounding
    ]
