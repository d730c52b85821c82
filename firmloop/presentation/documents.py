"""Say results in JSON: nouns to what `--json` and the result files hold; null where a figure is not known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from firmloop.design.design import Design
from firmloop.identify.fitting.fit import Fit, RecordingScore
from firmloop.identify.plants.plant import Parameter
from firmloop.stages.pipeline import Loop, Outcome


def outcomes_document(outcomes: Sequence[Outcome]) -> list[Mapping[str, object]]:
    """Return every verdict; a target that was not run says why."""
    return [
        outcome.verdict.as_dict() if outcome.verdict else {"target": outcome.target, "not_run": outcome.not_run}
        for outcome in outcomes
    ]


def cost_document(outcomes: Sequence[Outcome]) -> Mapping[str, object]:
    """Return cost.json: what a step takes on each target that counts, and each function of the controller there."""
    return {
        "schema": 1,
        "targets": {
            outcome.target: {
                "program_id": outcome.verdict.program_id,
                "compiler": outcome.verdict.compiler,
                "flags": list(outcome.verdict.flags),
                "cost": outcome.verdict.as_dict()["cost"],
                "functions": {
                    function.name: {
                        "instructions_max": outcome.verdict.cost.instructions_max
                        if function.name.endswith("_step")
                        else None,
                        "text_bytes": function.text_bytes,
                        "stack_bytes": function.stack_bytes,
                    }
                    for function in outcome.verdict.cost.functions
                },
            }
            for outcome in outcomes
            if outcome.verdict
        },
    }


def fit_document(fit: Fit) -> Mapping[str, object]:
    """Return what `--json` says of a fit."""
    return {
        "kind": fit.plant.kind,
        "parameters": {parameter.name: parameter_document(parameter) for parameter in fit.plant.parameters},
        "train": scores_document(fit.train),
        "test": scores_document(fit.test),
        "noise": dict(fit.noise),
        "warnings": list(fit.warnings),
    }


def parameter_document(parameter: Parameter) -> Mapping[str, object]:
    """Return value, unit and 95 % interval; null where there is none."""
    interval = parameter.interval_95
    return {
        "value": parameter.value,
        "unit": parameter.unit,
        "free": parameter.free,
        "ci95": None if interval is None else list(interval),
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
