"""Say where simulation and recordings differ and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from firmloop.diagnose.controller.replay import Cut, cut
from firmloop.diagnose.controller.report import with_controller
from firmloop.diagnose.data.conditioned import as_conditioned
from firmloop.diagnose.model.candidate import rms_of
from firmloop.diagnose.run import Diagnosis, diagnose
from firmloop.diagnose.sentences import with_doubt
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.checks.early import early_outputs
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.fit import tried
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.at_rest import begun_at_rest
from firmloop.project.project import Project
from firmloop.stages.data import Data, conditioning_of
from firmloop.stages.fitting import check_logs, identify
from firmloop.stages.plant import located, recorded_plant_of
from firmloop.stages.progress import Report
from firmloop.stages.recorded_controller import controller_of

_MUCH = 1.5  # times the sensors' noise, left beside the best explanation


def diagnosed(project: Project, data: Data, report: Report) -> Diagnosis:
    """Diagnose the project on its recordings."""
    return both_halves(project, data, report)[0]


def both_halves(
    project: Project, data: Data, report: Report, fitted: Plant | None = None
) -> tuple[Diagnosis, Cut | None]:
    """Diagnose the fitted, else the project's plant on its recordings, and replay its controller where they hold it.

    A plant without values is identified first.
    """
    with located(project):
        plant = recorded_plant_of(project, fitted)
        conditioning = conditioning_of(project)
        check_logs("diagnose", plant, data, conditioning)
        if any(math.isnan(parameter.value) for parameter in plant.parameters):
            plant = identify(project, data, report).plant
        (train, notes), (test, _) = (as_conditioned(plant, part, conditioning) for part in (data.train, data.test))
        train = begun_at_rest(plant, train)
        with threadpool_limits(1):  # thousands of small products: threads would only wait for each other
            made = diagnose(plant, train, test, report)
            _check_early(plant, train, made)
        controller = controller_of(project)
        replayed = None if controller is None else cut(plant, controller, (*data.train, *data.test))
        told = (*data.notes, *notes)
        said = (*made.finding.says, *(f"Note: {note}." for note in told))
        finding = replace(made.finding, notes=(*made.finding.notes, *told), says=said)
        return replace(made, finding=with_controller(with_doubt(finding), replayed)), replayed


def _check_early(plant: Plant, train: Sequence[Recording], made: Diagnosis) -> None:
    """Refuse outputs that move before their input, where to shift them leaves less than the best explanation does.

    No physics does so; what was named instead would be chased in vain. It is asked only where much is left, of either
    with its initial states fitted; of a plant without memory always, where a clock a hair too quick, or any other
    effect on the time, explains as much. The fit begins at the refit, where there is one.
    """
    finding, refit = made.finding, made.search.refit
    still = not plant.states
    after = None if still else finding.train.after
    if (after or finding.train.refit or 0.0) < _MUCH:
        return
    begin = plant if refit is None else plant.valued({p.name: p.value for p in refit.parameters})
    fitted = tried(begin, train, NONE, near=refit is not None)
    if fitted is None:
        return  # what identify cannot fit has no lag that could be told
    shown = made.search.nominal if still else made.shown
    sizes = [rms_of(each.fitted.residuals) for each in (made.search.nominal, shown)]
    left = dict(zip((signal.name for signal in plant.outputs), map(float, np.minimum(*sizes)), strict=True))
    said = early_outputs(Evidence(plant, tuple(train), NONE, fitted), left)
    if said:
        raise IdentifyError(said)
