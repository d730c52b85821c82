"""Fit the plant of a project to its recordings."""

from __future__ import annotations

import re
from dataclasses import replace

from threadpoolctl import threadpool_limits

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.checks import first_causes, no_noise, refuse, told
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.fit import CERTAIN, Fit, estimate, judge
from firmloop.identify.fitting.residual_tests import POOR, likelier
from firmloop.identify.fitting.starting_points import unguided
from firmloop.identify.plants.attach import told_names
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import Conditioning
from firmloop.identify.simulation.at_rest import begun_at_rest
from firmloop.identify.simulation.bridge_columns import check_bridges
from firmloop.identify.simulation.simulate import measured
from firmloop.project.project import Project
from firmloop.stages.data import Data, conditioning_of
from firmloop.stages.plant import located, recorded_plant_of
from firmloop.stages.progress import Report
from firmloop.stages.saturation import cut_input, cut_output, saturated


def check_logs(verb: str, plant: Plant, data: Data, conditioning: Conditioning) -> None:
    """Refuse, before a fit that could only go astray, logs that no such plant and no clock can have left."""
    recordings = (*data.train, *data.test)
    check_bridges(plant, recordings)
    refuse(Evidence(plant, recordings, conditioning, None), verb)


def _begun(project: Project, data: Data) -> Data:
    """Return the data with those recordings to fit marked that are taken to begin at rest."""
    return replace(data, train=begun_at_rest(recorded_plant_of(project), data.train))


def _refuse_causes(evidence: Evidence) -> None:
    """Refuse what a fit fails of in the words of the check that sees why; do nothing where none does."""
    remarks = told(evidence)
    if first_causes(remarks):
        raise IdentifyError("; ".join(one.says for one in remarks)) from None


def identify(project: Project, data: Data, report: Report) -> Fit:
    """Fit the plant to the train recordings; score it on train and test."""
    with located(project), threadpool_limits(1):  # small matrices: a second thread would only wait for the first
        data = _begun(project, data)
        fitted, evidence = _fitted(project, data, report)
        report(0.95, "checking units, signs, levels and residuals")
        remarks = told(evidence)
        caused = first_causes(remarks)
        if not caused:
            judge(fitted, data.train, evidence.conditioning)
    failed = any(one.check == "spikes" for one in remarks)  # such a reading is no limit that a signal runs into
    limits = (saturated(project, data.train) or cut_input(project, data.train), cut_output(project, data.train))
    seen = () if failed else limits
    own = () if caused else fitted.warnings
    noted = (_placed(fitted.plant, text) for text in (*(one.says for one in remarks), *own))
    said = (*data.notes, *noted, *filter(None, seen))
    return replace(fitted, warnings=tuple(dict.fromkeys(said)), lacking=caused or no_noise(remarks))


def _placed(plant: Plant, text: str) -> str:
    """Tell parameters in a remark with their places, as the table of them does."""
    for name, placed in told_names(plant).items():
        if placed != name:
            text = re.sub(rf"(?<![\w.]){re.escape(name)}(?!\w)", placed, text)
    return text


def fit_alone(project: Project, data: Data) -> Fit:
    """Fit as `identify` does, without its remarks: by them kinds are not compared."""
    with located(project), threadpool_limits(1):
        data = _begun(project, data)
        fitted, evidence = _fitted(project, data, lambda share, doing: None)
        try:
            judge(fitted, data.train, evidence.conditioning)
        except IdentifyError:
            if not first_causes(told(evidence)):
                raise
    return fitted


def _fitted(project: Project, data: Data, report: Report) -> tuple[Fit, Evidence]:
    """Fit the plant, and return with the fit what the checks look at."""
    assert project.recordings is not None, "require() has seen to it"
    plant, conditioning = recorded_plant_of(project), conditioning_of(project)
    check_logs("identify", plant, data, conditioning)
    try:
        fitted = _best(plant, data, conditioning, report)
    except IdentifyError:
        _refuse_causes(Evidence(plant, data.train, conditioning, None))
        raise
    return fitted, Evidence(plant, data.train, conditioning, fitted)


def _best(plant: Plant, data: Data, conditioning: Conditioning, report: Report) -> Fit:
    """Fit from the values as given; where that fails, and values from the recordings do better, from those.

    It has failed, too, where the recordings told it nothing of a value that it may change: it stands where it began.
    """
    fitted = estimate(plant, data.train, data.test, conditioning, report)
    bare = unguided(plant)
    blind = any(each.free and each.deviation is None for each in fitted.plant.parameters)
    stands = fitted.explained >= POOR and not blind and _stands(fitted, data, conditioning)
    if bare is None or bare == plant or stands:
        return fitted
    try:
        again = estimate(bare, data.train, data.test, conditioning, report)
    except IdentifyError:
        return fitted
    left = [measured(plant, one) - score.simulated for one, score in zip(data.train, again.train, strict=True)]
    return again if likelier(fitted.noise, again.noise, left) > CERTAIN else fitted


def _stands(fitted: Fit, data: Data, conditioning: Conditioning) -> bool:
    try:
        judge(fitted, data.train, conditioning)
    except IdentifyError:
        return False
    return True
