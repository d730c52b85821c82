"""Tell what step responses show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from firmloop.console import table
from firmloop.identify.bench_tests.trials import FEWEST, Repeated, repeated
from firmloop.identify.units import unit_of
from firmloop.presentation.documents import fields_document, finite
from firmloop.presentation.words import NOT_REACHED, in_unit, quantity, rounded_to
from firmloop.stages.bench.step_tests import SAYS, Halves

if TYPE_CHECKING:
    from firmloop.identify.bench_tests.step_response import StepFigures, StepResponse

UNITS = {"rise_s": "s", "settling_2_s": "s", "settling_5_s": "s", "peak_s": "s", "overshoot_percent": "%"}


def about_steps(
    responses: Sequence[StepResponse],
    figures: Sequence[StepFigures],
    read: Mapping[str, Sequence[Mapping[str, float] | str]],
    halves: Halves,
) -> list[str]:
    """Figures with their intervals over the trials, or from the noise of one; no digits that those do not hold."""
    count, unit = len(responses), responses[0].unit
    lines = [f"step response: {count} trial{'s' if count > 1 else ''}, {responses[0].source} first"]
    rows = []
    for name, says in SAYS.items():
        values = [getattr(one, name) for one in figures]
        if not all(math.isnan(value) for value in values):
            half = halves.get("figures", {}).get(name, math.nan)
            rows.append((says, _over(values, UNITS.get(name, unit if name != "gain" else ""), half)))
    lines += table(rows)
    lines.append("models read off the curve")
    rows = []
    for name, found in read.items():
        models = [one for one in found if not isinstance(one, str)]
        if len(models) < len(found):
            rows.append((name, next(one for one in found if isinstance(one, str))))
            continue
        own = halves.get(name, {})
        words = [
            f"{key} {_over([one[key] for one in models], unit_of(key), own.get(key, math.nan))}" for key in models[0]
        ]
        rows.append((name, ", ".join(words)))
    lines += table(rows)
    if count < FEWEST:
        lines.append(
            f"  note: the 95 % intervals hold the noise of {responses[0].source} alone; for what differs from trial to "
            f"trial name at least {FEWEST} of them in recordings.train"
        )
    return lines


def _over(values: Sequence[float], unit: str, half: float) -> str:
    if len(values) < FEWEST:
        return ", ".join(_held(value, unit, half) for value in values)
    found = repeated(values)
    if not math.isfinite(found.half) or found.half == 0.0:
        return quantity(found.mean, unit, NOT_REACHED)
    return in_unit(f"{rounded_to(found.mean, found.half)} ± {found.half:.2g}", unit)


def _held(value: float, unit: str, half: float) -> str:
    """Write a value with its interval; one that has none, or does not move with the noise, with three digits."""
    if not (math.isfinite(value) and math.isfinite(half) and half > 0.0):
        return quantity(value, unit, NOT_REACHED)
    return in_unit(f"{rounded_to(value, half)} ± {half:.2g}", unit)


def steps_document(
    responses: Sequence[StepResponse],
    figures: Sequence[StepFigures],
    read: Mapping[str, Sequence[Mapping[str, float] | str]],
    halves: Halves,
) -> dict[str, object]:
    """Return what `--json` and the result file say."""
    trials = [
        {
            "recording": response.source,
            "input": list(response.drive),
            "noise": response.noise,
            "figures": fields_document(found),
            "models": {name: models[k] for name, models in read.items()},
        }
        for k, (response, found) in enumerate(zip(responses, figures, strict=True))
    ]
    over: dict[str, object] = {}
    if len(responses) >= FEWEST:
        over = {name: _repeated([getattr(one, name) for one in figures]) for name in SAYS}
    noise = {name: {key: finite(half) for key, half in own.items()} for name, own in halves.items()}
    return {"trials": trials, "over_trials": over, "ci95_half_from_noise": noise}


def _repeated(values: Sequence[float]) -> Mapping[str, object]:
    found: Repeated = repeated(values)
    return {"mean": finite(found.mean), "ci95_half": finite(found.half), "deviation": finite(found.deviation)}
