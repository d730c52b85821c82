"""`firmloop step`: measure step responses, trial by trial, and read models off them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from codegen.bundle import write_files
from firmloop.console import Console, table
from firmloop.documents import fields_document, finite
from firmloop.output import results_folder
from firmloop.pipeline import read_data
from firmloop.project import Project, require
from firmloop.saturation import refuse_saturated
from firmloop.words import in_unit, quantity, rounded_to
from identify.graphical import METHODS
from identify.plant import IdentifyError
from identify.step_response import StepFigures, StepResponse, step_figures, step_response
from identify.trials import FEWEST, Repeated, repeated
from identify.units import unit_of

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
        document = _document(responses, figures, read)
        write_files({"step.json": json.dumps({"schema": 1, **document}, indent=1) + "\n"}, folder)
    console.lines(about_steps(responses, figures, read))
    console.result("step", document)
    console.result("written", [str(out / "step.json")])
    return 0


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
) -> list[str]:
    """Figures with their intervals over the trials; without digits that the interval does not hold."""
    count, unit = len(responses), responses[0].unit
    lines = [f"step response: {count} trial{'s' if count > 1 else ''}, {responses[0].source} first"]
    rows = []
    for name, says in SAYS.items():
        values = [getattr(one, name) for one in figures]
        if not all(math.isnan(value) for value in values):
            rows.append((says, _over(values, UNITS.get(name, unit if name != "gain" else ""))))
    lines += table(rows)
    lines.append("models read off the curve")
    rows = []
    for name, found in read.items():
        models = [one for one in found if not isinstance(one, str)]
        if len(models) < len(found):
            rows.append((name, next(one for one in found if isinstance(one, str))))
            continue
        words = [f"{key} {_over([one[key] for one in models], unit_of(key))}" for key in models[0]]
        rows.append((name, ", ".join(words)))
    lines += table(rows)
    if count < FEWEST:
        lines.append(f"  note: no intervals; they need at least {FEWEST} trials in recordings.train")
    return lines


def _over(values: Sequence[float], unit: str) -> str:
    if len(values) < FEWEST:
        return ", ".join(quantity(value, unit) for value in values)
    found = repeated(values)
    if not math.isfinite(found.half) or found.half == 0.0:
        return quantity(found.mean, unit)
    return in_unit(f"{rounded_to(found.mean, found.half)} ± {found.half:.2g}", unit)


def _document(
    responses: Sequence[StepResponse],
    figures: Sequence[StepFigures],
    read: Mapping[str, Sequence[Mapping[str, float] | str]],
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
    return {"trials": trials, "over_trials": over}


def _repeated(values: Sequence[float]) -> Mapping[str, object]:
    found: Repeated = repeated(values)
    return {"mean": finite(found.mean), "ci95_half": finite(found.half), "deviation": finite(found.deviation)}
