"""Tell how far a fit can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from firmloop.console import table
from firmloop.identify.bench_tests.sensitivity import FIGURES, Sensitivity
from firmloop.identify.fitting.fit import Fit
from firmloop.identify.fitting.residual_tests import POOR, ResidualTests
from firmloop.identify.normal import NORMAL_95
from firmloop.presentation.documents import fields_document, finite, fit_document
from firmloop.presentation.words import in_unit, rounded_to

if TYPE_CHECKING:
    from firmloop.identify.fitting.redraw import Redrawn
    from firmloop.identify.plants.plant import Parameter
    from firmloop.stages.bench.examination import Examination

LEFT = "NOT all explained"
TITLES = {
    "final": "final value",
    "rise_s": "rise time",
    "settling_2_s": "settling 2 %",
    "overshoot_percent": "overshoot",
}


def about_examination(found: Examination) -> list[str]:
    """Intervals of three kinds, residual tests, sensitivities, and what conditioning changed."""
    drawn, again = found.monte_carlo, found.bootstrap
    free = [parameter for parameter in found.fit.plant.parameters if parameter.name in drawn.names]
    rows: list[tuple[str, ...]] = [
        ("", "covariance", f"Monte Carlo ({len(drawn.draws)})", f"bootstrap ({len(again.draws)})")
    ]
    for parameter in free:
        ends = (parameter.interval_95, drawn.interval_95(parameter.name), again.interval_95(parameter.name))
        rows.append((parameter.name, *(_interval(end, parameter.unit) for end in ends)))
    given = ["no parameter is free: nothing to draw intervals of"]
    lines = [
        *(["95 % intervals", *table(rows)] if free else given),
        "residuals (chance that it is so where the model is right)",
    ]
    tests = [
        (
            source,
            output,
            f"white {test.whiteness:.2g}",
            f"independent of the input {test.independence:.2g}",
            f"mean 0 {test.bias:.2g}",
            _verdict(test, found.fit),
        )
        for source, outputs in found.residuals.items()
        for output, test in outputs.items()
    ]
    lines += table(tests)
    if any(not test.white for outputs in found.residuals.values() for test in outputs.values()):
        lines.append(
            "  note: the residuals have a memory, which Monte Carlo's white noise has not: take the wider interval"
        )
    if found.sensitivity is None:
        lines.append(f"no sensitivities: {found.insensitive}")
    else:
        lines += _about_sensitivity(found.sensitivity)
    if found.unconditioned is not None:
        lines += _about_conditioning(found.fit, found.unconditioned)
    return lines


def _verdict(test: ResidualTests, fit: Fit) -> str:
    """Say what it means that residuals are not white: noise may have a memory, and answers neither input nor motion."""
    if test.explained:
        return ""
    return "noise with a memory" if test.answers_nothing and not fit.lacking and fit.explained >= POOR else LEFT


def _interval(ends: tuple[float, float] | None, unit: str) -> str:
    if ends is None:
        return "unknown"
    half = (ends[1] - ends[0]) / 2
    return in_unit(f"{rounded_to(ends[0], half)} to {rounded_to(ends[1], half)}" if half else f"{ends[0]:.4g}", unit)


def _about_sensitivity(found: Sensitivity) -> list[str]:
    lines = ["step response: change in % per % of a parameter (share of the variance: alone, in all)"]
    rows: list[tuple[str, ...]] = [("", *(TITLES[figure] for figure in FIGURES))]
    for name in found.ranges:
        words = []
        for figure in FIGURES:
            alone, whole = found.first[figure][name], found.total[figure][name]
            shares = f"({max(alone, 0):.0%}, {max(whole, 0):.0%})" if alone == alone else "(does not vary)"
            words.append(f"{found.local[figure][name]:+.2f} {shares}")
        rows.append((name, *words))
    return lines + table(rows)


def _about_conditioning(with_it: Fit, without: Fit) -> list[str]:
    rows: list[tuple[str, ...]] = [("", "conditioned", "as recorded", "moved by")]
    for one, other in _pairs(with_it, without):
        rows.append((one.name, _estimate(one), _estimate(other), _moved(one, other)))
    return ["effect of the conditioning on the estimate", *table(rows)]


def _pairs(one: Fit, other: Fit) -> Sequence[tuple[Parameter, Parameter]]:
    return [(a, b) for a, b in zip(one.plant.parameters, other.plant.parameters, strict=True) if a.free]


def _estimate(parameter: Parameter) -> str:
    half = NORMAL_95 * (parameter.deviation or 0.0)
    return f"{rounded_to(parameter.value, half)} ± {half:.2g}" if half else f"{parameter.value:.4g}"


def _moved(one: Parameter, other: Parameter) -> str:
    if not other.deviation:
        return "unknown"
    return f"{(one.value - other.value) / other.deviation:+.2f} standard deviations"


def examination_document(found: Examination) -> dict[str, object]:
    """Return what `--json` and the result file say."""
    drawn, again = found.monte_carlo, found.bootstrap
    conditioned = {}
    if found.unconditioned is not None:
        conditioned = {
            a.name: {"conditioned": a.value, "as_recorded": b.value, "deviation": b.deviation}
            for a, b in _pairs(found.fit, found.unconditioned)
        }
    return {
        "plant": fit_document(found.fit),
        "monte_carlo": {"draws": len(drawn.draws), "failed": drawn.failed, "ci95": _ends(drawn)},
        "bootstrap": {"draws": len(again.draws), "failed": again.failed, "ci95": _ends(again)},
        "residuals": {
            source: {output: fields_document(test) for output, test in outputs.items()}
            for source, outputs in found.residuals.items()
        },
        "sensitivity": None if found.sensitivity is None else _sensitivity(found.sensitivity),
        "conditioning": conditioned,
    }


def _ends(drawn: Redrawn) -> dict[str, list[float]]:
    return {name: list(drawn.interval_95(name)) for name in drawn.names}


def _sensitivity(found: Sensitivity) -> dict[str, object]:
    parts = {"local": found.local, "first_order": found.first, "total_order": found.total}
    named: dict[str, object] = {"ranges": {name: list(ends) for name, ends in found.ranges.items()}}
    for title, values in parts.items():
        named[title] = {figure: {name: finite(value) for name, value in row.items()} for figure, row in values.items()}
    return named
