"""Say results in JSON: nouns to what `--json` and the result files hold; null where a figure is not known."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop.identify.fitting.fit import Fit
from firmloop.identify.fitting.own_values import OwnValue
from firmloop.identify.fitting.scores import RecordingScore

if TYPE_CHECKING:
    from firmloop.design.design import Design
    from firmloop.identify.plants.plant import Parameter
    from firmloop.stages.analysis import Loop
    from firmloop.stages.making import Generated
    from firmloop.stages.verification import Outcome


def outcomes_document(outcomes: Sequence[Outcome]) -> list[Mapping[str, object]]:
    """Return every verdict; a target that was not run says why."""
    return [
        outcome.verdict.as_dict() if outcome.verdict else {"target": outcome.target, "not_run": outcome.not_run}
        for outcome in outcomes
    ]


def fit_document(fit: Fit) -> Mapping[str, object]:
    """Return what `--json` says of a fit."""
    return {
        "kind": fit.plant.kind,
        "parameters": {parameter.name: parameter_document(parameter) for parameter in fit.plant.parameters},
        "train": scores_document(fit.train),
        "test": scores_document(fit.test),
        "noise": {output: finite(rms) for output, rms in fit.noise.items()},
        "per_recording": own_document(fit.per_recording),
        "warnings": list(fit.warnings),
    }


def own_document(values: Sequence[OwnValue]) -> Mapping[str, Mapping[str, object]]:
    """Return what each recording has of its own, by name and recording."""
    names = dict.fromkeys(one.parameter.name for one in values)
    return {
        name: {Path(one.source).name: parameter_document(one.parameter) for one in values if one.parameter.name == name}
        for name in names
    }


def parameter_document(parameter: Parameter) -> Mapping[str, object]:
    """Return value, unit and 95 % interval; null where there is none."""
    interval = parameter.interval_95
    return {
        "value": finite(parameter.value),
        "unit": parameter.unit,
        "free": parameter.free,
        "ci95": None if interval is None else [finite(end) for end in interval],
    }


def scores_document(scores: Sequence[RecordingScore]) -> list[Mapping[str, object]]:
    """Return the scores of some recordings, output by output."""
    return [
        {
            "recording": Path(score.source).name,
            "outputs": {
                output: {
                    "fit_percent": finite(figures.fit_percent),
                    "rmse": finite(figures.rmse),
                    "mae": finite(figures.mae),
                    "r2": finite(figures.r2),
                }
                for output, figures in score.scores.items()
            },
        }
        for score in scores
    ]


def design_document(design: Design, loop: Loop | None) -> Mapping[str, object]:
    """Return what `--json` and design.json say of a controller; a margin that has no limit is null."""
    return {
        "says": design.law.says,
        "tuned_by": design.tuned_by,
        "gains": dict(design.gains),
        "not_met_by_feedforward": dict(design.not_met),
        "margins": None if loop is None else fields_document(loop.margins),
        "step": None if loop is None else fields_document(loop.metrics),
        "operating_points": [] if loop is None else [{"at": at, **fields_document(one)} for at, one in loop.points],
        "ci95_half": None if loop is None else {name: finite(half) for name, half in loop.halves.items()},
    }


def fields_document(noun: object) -> Mapping[str, object]:
    """Return the fields of a noun whose fields are figures."""
    names: Sequence[str] = getattr(type(noun), "__slots__", ())
    return {name: finite(getattr(noun, name)) for name in names}


def finite(value: object) -> object:
    """Return null for what JSON cannot write."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def result_json(document: Mapping[str, object]) -> str:
    """Write a result file whose figures need not all be known: null where one is not."""
    return as_json({"schema": 1, **{key: known(value) for key, value in document.items()}})


def known(value: object) -> object:
    """Return a document with null for every figure that is not known."""
    if isinstance(value, Mapping):
        return {key: known(entry) for key, entry in value.items()}
    return [known(entry) for entry in value] if isinstance(value, list | tuple) else finite(value)


def as_json(document: Mapping[str, object]) -> str:
    """Write a result file."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def c_files(generated: Generated) -> dict[str, str]:
    """Return every file of the C and around it, by its name."""
    return {**generated.package, "manifest.json": as_json(generated.manifest), "proof.json": as_json(generated.proof)}
