"""Fit the plant of a project to its recordings."""

from __future__ import annotations

from dataclasses import replace

from firmloop.identify.fitting.fit import Fit, fit
from firmloop.project.project import Project
from firmloop.stages.data import Data, conditioning_of
from firmloop.stages.plant import located, plant_of
from firmloop.stages.progress import Report
from firmloop.stages.saturation import cut_input, cut_output, saturated


def identify(project: Project, data: Data, report: Report) -> Fit:
    """Fit the plant to the train recordings; score it on train and test."""
    assert project.recordings is not None, "require() has seen to it"
    with located(project):
        fitted = fit(plant_of(project), data.train, data.test, conditioning_of(project), report)
    seen = (saturated(project, data.train) or cut_input(project, data.train), cut_output(project, data.train))
    return replace(fitted, warnings=(*data.notes, *fitted.warnings, *filter(None, seen)))
