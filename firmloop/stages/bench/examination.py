"""Find out how far a fit can be trusted, by more than one way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from firmloop.identify.bench_tests.sensitivity import Sensitivity, sensitivity
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.checks.structure import answers
from firmloop.identify.fitting.evidence import Evidence, remainders
from firmloop.identify.fitting.fit import Fit, fit
from firmloop.identify.fitting.redraw import Redrawn, blocks, left_over, redraw, white
from firmloop.identify.fitting.residual_tests import ResidualTests, residual_tests
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import column
from firmloop.project.project import Project
from firmloop.stages.data import Data, conditioning_of
from firmloop.stages.fitting import identify as identify_stage
from firmloop.stages.plant import located, recorded_plant_of

MOST_BOOTSTRAPS = 2000  # more change the third digit of an interval's end only


@dataclass(frozen=True, slots=True)
class Examination:
    """Everything that was found out about one fit."""

    fit: Fit
    monte_carlo: Redrawn
    bootstrap: Redrawn
    residuals: Mapping[str, Mapping[str, ResidualTests]]  # by recording, then output
    sensitivity: Sensitivity | None
    insensitive: str  # why there is no sensitivity
    unconditioned: Fit | None


def examination(project: Project, data: Data, draws: int, seed: int, report: object) -> Examination:
    """Run every examination on the project's fit."""
    assert callable(report)
    conditioning = conditioning_of(project)
    fitted = identify_stage(project, data, lambda share, doing: report(0.1 * share, doing))
    with located(project):
        drawn = redraw(fitted, data.train, conditioning, white, draws, seed, lambda s, d: report(0.1 + 0.6 * s, d))
        fewer = min(draws, MOST_BOOTSTRAPS)
        again = redraw(fitted, data.train, conditioning, blocks, fewer, seed, lambda s, d: report(0.7 + 0.1 * s, d))
        bare = None
        if conditioning != NONE:
            plant = recorded_plant_of(project)
            bare = fit(plant, data.train, (), NONE, lambda share, doing: report(0.8 + 0.1 * share, doing))
        varied, why = None, ""
        level = float(max((column(one, fitted.plant.inputs[0].name) for one in data.train), key=np.ptp).max())
        try:
            report(0.9, "varying the parameters")
            varied = sensitivity(fitted.plant, level or 1.0, seed)
        except IdentifyError as error:
            why = str(error)
    evidence = Evidence(fitted.plant, data.train, conditioning, fitted)
    told = answers(evidence, remainders(evidence))
    tests = {
        source: {
            name: replace(residual_tests(column, drive[:, 0]), answering=share)
            for (name, share), column in zip(shares.items(), left.T, strict=True)
        }
        for (source, shares), (left, drive) in zip(told, left_over(fitted, data.train, conditioning), strict=True)
    }
    return Examination(fitted, drawn, again, tests, varied, why, bare)
