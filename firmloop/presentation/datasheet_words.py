"""Tell what a datasheet and its tests say, and where they contradict each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from firmloop.console import table
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.units import unit_of
from firmloop.presentation.documents import finite
from firmloop.presentation.words import in_unit, rounded_to

if TYPE_CHECKING:
    from firmloop.identify.bench_tests.datasheets import Contradiction, Reading, Sheet
    from firmloop.identify.bench_tests.motor_forms import MotorForm
    from firmloop.stages.bench.datasheet import Found


def about_datasheet(
    sheet: Sheet,
    reading: Reading,
    found: Mapping[str, Found],
    forms: Mapping[str, MotorForm],
    told: Sequence[str],
    missing: Sequence[str],
) -> list[str]:
    """Parameters with where they are from, standard forms, contradictions, and what is missing."""
    lines = [f"{sheet.kind} by its datasheet and tests"]
    lines += table([(name, _figure(name, one), one.origin) for name, one in found.items()])
    for order, form in forms.items():
        above, below = _polynomial(form.numerator), _polynomial(form.denominator)
        lines.append(f"  {order}: speed/voltage = {above} / ({below}), states {', '.join(form.states)}")
        lines.append(f"    a = {_matrix(form.a)}, b = {_matrix(form.b)}, c = {_matrix(form.c)}")
    if any(one.tolerance for one in found.values()):
        lines.append(
            "  note: a datasheet gives no 95 % intervals; ± after its figures is what datasheet.tolerance allows"
        )
    lines += [f"  CONTRADICTION: {sentence}" for sentence in told]
    if missing:
        ways = "; ".join(f"{name}: give {_ways(sheet, name)}" for name in missing)
        lines.append(f"  no project.toml was written, for the figures do not lead to {', '.join(missing)} ({ways})")
    return lines


def _ways(sheet: Sheet, name: str) -> str:
    figure = sheet.parameters[name]
    others = [" and ".join(r.needs) for r in sheet.relations if r.figure == figure]
    return " or ".join([figure, *others])


def _figure(name: str, one: Found) -> str:
    half = NORMAL_95 * (one.deviation or 0.0) or one.tolerance
    figure = f"{rounded_to(one.value, half)} ± {half:.2g}" if half and one.value else f"{one.value:.4g}"
    return in_unit(figure, unit_of(name))


def _polynomial(coefficients: tuple[float, ...]) -> str:
    powers = {0: "", 1: " s"}
    last = len(coefficients) - 1
    return " + ".join(f"{c:.3g}{powers.get(last - k, f' s^{last - k}')}" for k, c in enumerate(coefficients))


def _matrix(matrix: object) -> str:
    rows = np.atleast_2d(np.asarray(matrix))
    return "[" + "; ".join(" ".join(f"{value:.3g}" for value in row) for row in rows) + "]"


def datasheet_document(
    sheet: Sheet, reading: Reading, found: Mapping[str, Found], forms: Mapping[str, MotorForm], told: Sequence[str]
) -> dict[str, object]:
    """Return what `--json` and datasheet.json say."""
    return {
        "plant": sheet.kind,
        "figures": {
            name: {"value": value, "unit": sheet.figures.get(name, ""), "derived": name in reading.derived}
            for name, value in reading.figures.items()
        },
        "parameters": {
            name: {
                "value": one.value,
                "unit": unit_of(name),
                "deviation": one.deviation,
                "tolerance": one.tolerance,
                "origin": one.origin,
            }
            for name, one in found.items()
        },
        "forms": {
            order: {
                "numerator": list(form.numerator),
                "denominator": list(form.denominator),
                "states": list(form.states),
                **{key: np.asarray(getattr(form, key)).tolist() for key in "abc"},
            }
            for order, form in forms.items()
        },
        "contradictions": [_contradiction(entry) for entry in reading.contradictions],
        "said": list(told),
    }


def _contradiction(entry: Contradiction) -> dict[str, object]:
    return {
        "figure": entry.figure,
        "printed": entry.printed,
        "computed": entry.computed,
        "share": finite(entry.share),
        "from": list(entry.others),
        "formula": entry.relation.says,
        "source": entry.relation.source,
    }
