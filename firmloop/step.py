"""`firmloop step`: measure step responses, trial by trial, and read models off them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.console import Console, table
from firmloop.identify.bench_tests.graphical import METHODS
from firmloop.identify.bench_tests.step_noise import DRAWS, noise_halves
from firmloop.identify.bench_tests.step_response import StepFigures, StepResponse, step_figures, step_response
from firmloop.identify.bench_tests.trials import FEWEST, Repeated, repeated
from firmloop.identify.error import IdentifyError
from firmloop.identify.units import unit_of
from firmloop.output import results_folder
from firmloop.presentation.documents import fields_document, finite
from firmloop.presentation.words import in_unit, quantity, rounded_to
from firmloop.project.project import Project, require
from firmloop.stages.pipeline import read_data
from firmloop.stages.saturation import refuse_saturated

Halves = Mapping[str, Mapping[str, float]]  # of 95 % intervals, by what is read and figure

UNITS = {"rise_s": "s", "settling_2_s": "s", "settling_5_s": "s", "peak_s": "s", "overshoot_percent": "%"}
SAYS = {
    "gain": "gain",
    "rise_s": "rise time 10-90 %",
    "settling_2_s": "settling time 2 %",
    "settling_5_s": "settling time 5 %",
    "overshoot_percent": "overshoot",
    "peak_s": "peak time",
    "final": "final value",
    "steady_state_error": "steady-state error",
}


def step(project: Project, out: Path, console: Console) -> int:
    """Measure every train recording as one trial; OUT/step.json holds all figures."""
    require(project, "recordings", "plant")
    assert project.plant is not None
    drive, output = project.plant.input, project.plant.outputs[0]
    with results_folder(out, ()) as folder:
        trials = read_data(project).train
        refuse_saturated(project, trials)
        responses = [step_response(recording, drive, output) for recording in trials]
        figures = [step_figures(response, expected(response, project)) for response in responses]
        read = {method.name: [_read(method.read, response) for response in responses] for method in METHODS}
        readers = {"figures": measured, **{method.name: method.read for method in METHODS}}
        halves = noise_halves(responses[0], readers, DRAWS) if len(responses) < FEWEST else {}
        if halves:  # what was expected is known, so that the error is as unsure as the final value
            halves["figures"]["steady_state_error"] = halves["figures"]["final"]
        document = _document(responses, figures, read, halves)
        write_files({"step.json": json.dumps({"schema": 1, **document}, indent=1) + "\n"}, folder)
    console.lines(about_steps(responses, figures, read, halves))
    console.result("step", document)
    console.result("written", [str(out / "step.json")])
    return 0


def measured(response: StepResponse) -> Mapping[str, float]:
    """Return the figures of a response by name."""
    found = step_figures(response)
    return {name: getattr(found, name) for name in SAYS}


def expected(response: StepResponse, project: Project) -> float:
    """Return the final value that the plant's given gain promises; NaN where no gain is given."""
    assert project.plant is not None
    given = project.plant.parameters.get("gain")
    gain = given.get("value") if isinstance(given, Mapping) else given
    return (
        response.start + float(gain) * (response.drive[1] - response.drive[0])
        if isinstance(gain, int | float)
        else (math.nan)
    )


def _read(method: object, response: StepResponse) -> Mapping[str, float] | str:
    """Read one model; the reason where the response does not hold it."""
    assert callable(method)
    try:
        found: Mapping[str, float] = method(response)
    except IdentifyError as error:
        return str(error)
    return found


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
        return quantity(found.mean, unit)
    return in_unit(f"{rounded_to(found.mean, found.half)} ± {found.half:.2g}", unit)


def _held(value: float, unit: str, half: float) -> str:
    """Write a value with its interval; one that has none, or does not move with the noise, with three digits."""
    if not (math.isfinite(value) and math.isfinite(half) and half > 0.0):
        return quantity(value, unit)
    return in_unit(f"{rounded_to(value, half)} ± {half:.2g}", unit)


def _document(
    responses: Sequence[StepResponse],
    figures: Sequence[StepFigures],
    read: Mapping[str, Sequence[Mapping[str, float] | str]],
    halves: Halves,
) -> dict[str, object]:
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
