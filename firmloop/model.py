"""`firmloop model`: a linear model from data alone, written as equations that every other verb takes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import scipy

from firmloop.codegen.bundle import write_files
from firmloop.console import Console, progress, table
from firmloop.identify.bench_tests.blackbox import (
    EVEN,
    STRUCTURES,
    Continuous,
    Record,
    SampledModel,
    check_answer,
    check_records,
    continuous,
    redrawn,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit_start
from firmloop.identify.fitting.residual_tests import residual_tests
from firmloop.identify.fitting.scores import scores
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE, condition_input, condition_output
from firmloop.identify.recordings.recording import Recording, column
from firmloop.identify.simulation.simulate import simulate
from firmloop.output import results_folder
from firmloop.presentation.documents import finite
from firmloop.presentation.words import rounded_to
from firmloop.project.project import Project, require
from firmloop.project.project_text import made_text
from firmloop.project.table import Table
from firmloop.stages.pipeline import conditioning_of, located, read_data
from firmloop.stages.saturation import cut_input, refuse_saturated

MOST_ORDER = 12
DRAWS = 40  # of the model with its own residuals, for intervals
WHITE = 0.01  # least probability of residuals as white as these: else drawing them anew is no repetition


def model(project: Project, out: Path, console: Console) -> int:
    """Fit `[model]` to the train recordings; OUT/project.toml holds it as an ode, OUT/model.json all figures."""
    require(project, "plant", "recordings")
    assert project.plant is not None
    asked = project.document.table("model")
    asked.only(("structure", "order", "delay_samples"))
    structure = asked.text("structure", 'structure = "oe"') if "structure" in asked.values else "oe"
    if structure not in STRUCTURES:
        raise asked.wrong("structure", f"is no model structure; known: {', '.join(STRUCTURES)}")
    order, late = _whole(asked, "order", 2, 1, MOST_ORDER), _whole(asked, "delay_samples", 0, 0, 10_000)
    data = read_data(project)
    refuse_saturated(project, data.train)
    with results_folder(out, ()) as folder, located(project):
        with progress(f"fitting {structure}"):
            period = _period(data.train)
            records = [_record(project, recording) for recording in data.train]
            check_records(records, order, late)
            sampled = STRUCTURES[structure](records, order, late)
            check_answer(records, sampled)
            made = continuous(sampled, period)
        plant = _ode(project, made)
        judged = {
            role: [_judge(project, plant, recording) for recording in recordings]
            for role, recordings in (("train", data.train), ("test", data.test))
        }
        with progress("drawing the residuals anew"):
            spread = _spread(structure, records, sampled, period, judged["train"])
        result = _document(structure, period, sampled, made, judged) | {"ci95_half": spread}
        files = {
            "model.json": json.dumps({"schema": 1, **result}, indent=1) + "\n",
            "project.toml": made_text(project, plant, "model", out),
        }
        write_files(files, folder)
    cut = cut_input(project, data.train)
    console.lines(_lines(structure, made, judged, spread) + ([f"  note: {cut}"] if cut else []))
    console.result("model", result)
    console.lines([f"written: {out / 'project.toml'}"])
    console.result("written", [str(out / name) for name in files])
    return 0


def _whole(part: Table, key: str, default: int, low: int, high: int) -> int:
    value = part.values.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise part.wrong(key, f"must be a whole number from {low} to {high}")
    return value


def _period(recordings: Sequence[Recording]) -> float:
    """Return the one sampling time of all recordings, s."""
    steps = [np.diff(recording.time) for recording in recordings]
    period = float(np.median(steps[0]))
    for recording, step in zip(recordings, steps, strict=True):
        if recording.hold != "zero_order":
            raise IdentifyError(
                f"recordings.hold is {recording.hold!r}; a black-box model takes its input as held between rows: leave "
                "it out, or fit a plant with physics"
            )
        if np.abs(step - period).max() > EVEN * period + 1e-12:
            raise IdentifyError(
                f"{recording.source}: rows are {step.min():g} to {step.max():g} s apart, and a black-box model needs "
                f"one distance, here {period:g} s; resample the file, or fit a plant with physics, which takes it as "
                "it is"
            )
    return period


def _record(project: Project, recording: Recording) -> Record:
    assert project.plant is not None
    conditioning, drive, output = conditioning_of(project), project.plant.input, project.plant.outputs[0]
    u = condition_input(conditioning, drive, column(recording, drive))
    y = column(recording, output)
    if conditioning != NONE and not conditioning.resample_s:
        y = condition_output(conditioning, output, recording.time, y)
    return Record(recording.source, u, y)


def _ode(project: Project, made: Continuous) -> Mapping[str, object]:
    """Write the model as an `ode` plant of the contract; its whole samples of delay are an effect."""
    assert project.plant is not None
    drive, output = project.plant.input, project.plant.outputs[0]
    states = [f"x{k}" for k in range(1, len(made.a) + 1)]
    derivatives = {name: _sum([*made.a[k], made.b[k]], [*states, drive]) for k, name in enumerate(states)}
    plant: dict[str, object] = {
        "kind": "ode",
        "states": states,
        "inputs": [drive],
        "outputs": {output: _sum(made.c, states)},
        "derivatives": derivatives,
    }
    if made.delay > 0.0:
        plant["effects"] = [{"name": "input_delay", "delay_s": made.delay}]
    return plant


def _sum(factors: Sequence[float] | np.ndarray, names: Sequence[str]) -> str:
    words = [f"({float(factor)!r})*{name}" for factor, name in zip(factors, names, strict=True) if factor != 0.0]
    return " + ".join(words) or "0.0"


def _judge(project: Project, table_of_plant: Mapping[str, object], recording: Recording) -> Mapping[str, object]:
    """Simulate a recording from the start that fits best; score the whole of it and test what is left."""
    plant, conditioning = plant_from_table(table_of_plant), conditioning_of(project)
    assert project.plant is not None
    drive, output = project.plant.input, project.plant.outputs[0]
    simulated = simulate(plant, recording, fit_start(plant, recording, conditioning))[:, 0]
    measured = column(recording, output)
    if output in conditioning.remove_offset:
        measured, simulated = measured - measured.mean(), simulated - simulated.mean()
    found, tests = scores(measured, simulated), residual_tests(measured - simulated, column(recording, drive))
    return {
        "recording": recording.source,
        "fit_percent": finite(found.fit_percent),
        "rmse": found.rmse,
        "r2": finite(found.r2),
        "whiteness": tests.whiteness,
        "independence": tests.independence,
    }


def _spread(
    structure: str,
    records: Sequence[Record],
    sampled: SampledModel,
    period: float,
    judged: Sequence[Mapping[str, object]],
) -> Mapping[str, object] | None:
    """Return half widths of the 95 % intervals of gain and poles; None where the residuals do not allow any.

    Nor are there any by n4sid: it takes seconds a draw.
    """
    if structure == "n4sid" or not _white(judged):
        return None
    try:
        drawn = [continuous(one, period) for one in redrawn(structure, records, sampled, DRAWS)]
    except IdentifyError:  # some draw has no continuous model: neither has its spread a meaning
        return None
    factor = float(scipy.stats.t.ppf(0.975, DRAWS - 1))
    poles = np.array([_poles(one) for one in drawn])
    return {
        "gain": factor * float(np.std([_gain(one) for one in drawn], ddof=1)),
        "poles_rad_s": [
            [factor * float(np.std(part, ddof=1)) for part in (column.real, column.imag)] for column in poles.T
        ],
    }


def _white(judged: Sequence[Mapping[str, object]]) -> bool:
    """Tell whether every recording's residuals are white."""
    return all(isinstance(one["whiteness"], float) and one["whiteness"] >= WHITE for one in judged)


def _poles(made: Continuous) -> np.ndarray:
    return np.sort_complex(np.linalg.eigvals(made.a).astype(np.complex128))


def _lines(
    structure: str,
    made: Continuous,
    judged: Mapping[str, Sequence[Mapping[str, object]]],
    spread: Mapping[str, object] | None,
) -> list[str]:
    poles, halves = _poles(made), [] if spread is None else spread["poles_rad_s"]
    assert isinstance(halves, list)
    words = [f"{p.real:.2g}" if abs(p.imag) < 1e-9 * abs(p) else f"{p.real:.2g}{p.imag:+.2g}j" for p in poles]
    lines = [f"model: {structure} of order {len(made.a)}, delay {made.delay:g} s"]
    if spread is None:
        lines.append(f"  gain at rest {_gain(made):.2g}, poles {', '.join(words)} rad/s")
        why = "they need structure = 'arx' or 'oe'"
        if structure != "n4sid" and _white(judged["train"]):
            why = "with its residuals drawn anew the model has no continuous form any more; lower order"
        elif structure != "n4sid":
            why = "the residuals are not white, so that drawing them anew repeats nothing; raise order"
        if structure == "arx":
            why += ", or take structure = 'oe' where the noise is the sensor's"
        lines.append(f"  note: no intervals; {why}")
    else:
        lines.append(f"  gain at rest  {_with(_gain(made), spread['gain'])}")
        for pole, (real, imaginary) in zip(poles, halves, strict=True):
            turning = "" if abs(pole.imag) < 1e-9 * abs(pole) else f", {_with(pole.imag, imaginary)} j"
            lines.append(f"  pole          {_with(pole.real, real)}{turning} rad/s")
    rows = [
        (
            f"{role} {entry['recording']}",
            f"fit {entry['fit_percent']:.1f} %",
            f"rmse {entry['rmse']:.3g}",
            f"white {entry['whiteness']:.2g}",
            f"independent of the input {entry['independence']:.2g}",
        )
        for role, entries in judged.items()
        for entry in entries
    ]
    return lines + table(rows)


def _with(value: float, half: object) -> str:
    """Write a value with its half width, and no digit beyond it."""
    assert isinstance(half, float)
    return f"{value:.3g}" if half == 0.0 else f"{rounded_to(value, half)} ± {half:.2g}"


def _gain(made: Continuous) -> float:
    try:
        return float(-made.c @ np.linalg.solve(made.a, made.b))
    except np.linalg.LinAlgError:
        return float("inf")


def _document(
    structure: str,
    period: float,
    sampled: SampledModel,
    made: Continuous,
    judged: Mapping[str, Sequence[Mapping[str, object]]],
) -> dict[str, object]:
    poles = _poles(made)
    return {
        "structure": structure,
        "order": len(made.a),
        "period_s": period,
        "delay_s": made.delay,
        "discrete": {"a": sampled.a.tolist(), "b": sampled.b.tolist(), "c": sampled.c.tolist()},
        "continuous": {"a": made.a.tolist(), "b": made.b.tolist(), "c": made.c.tolist()},
        "poles_rad_s": [[float(pole.real), float(pole.imag)] for pole in poles],
        "gain": finite(_gain(made)),
        **judged,
    }
