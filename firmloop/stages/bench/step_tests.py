"""Measure step responses, trial by trial, and read models off them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from firmloop.identify.bench_tests.graphical import METHODS
from firmloop.identify.bench_tests.step_noise import DRAWS, noise_halves
from firmloop.identify.bench_tests.step_response import StepFigures, StepResponse, step_figures, step_response
from firmloop.identify.bench_tests.trials import FEWEST
from firmloop.identify.error import IdentifyError
from firmloop.project.project import Project, require
from firmloop.stages.data import read_data
from firmloop.stages.saturation import refuse_saturated

Halves = Mapping[str, Mapping[str, float]]  # of 95 % intervals, by what is read and figure
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


def read_model(method: object, response: StepResponse) -> Mapping[str, float] | str:
    """Read one model; the reason where the response does not hold it."""
    assert callable(method)
    try:
        found: Mapping[str, float] = method(response)
    except IdentifyError as error:
        return str(error)
    return found


@dataclass(frozen=True, slots=True)
class Steps:
    """One response a trial, its figures, the models read off it (or why there is none), and half widths from noise."""

    responses: Sequence[StepResponse]
    figures: Sequence[StepFigures]
    read: Mapping[str, Sequence[Mapping[str, float] | str]]  # by method
    halves: Halves
    notes: tuple[str, ...]  # how the files were read, where they are not plain


def measure_steps(project: Project) -> Steps:
    """Measure every train recording of the project as one trial."""
    require(project, "recordings", "plant")
    assert project.plant is not None
    trials = read_data(project).train
    refuse_saturated(project, trials)
    responses = [step_response(recording, project.plant.input, project.plant.outputs[0]) for recording in trials]
    figures = [step_figures(response, expected(response, project)) for response in responses]
    read = {method.name: [read_model(method.read, response) for response in responses] for method in METHODS}
    readers = {"figures": measured, **{method.name: method.read for method in METHODS}}
    halves = noise_halves(responses[0], readers, DRAWS) if len(responses) < FEWEST else {}
    if halves:  # what was expected is known, so that the error is as unsure as the final value
        halves["figures"]["steady_state_error"] = halves["figures"]["final"]
    return Steps(responses, figures, read, halves, tuple(note for trial in trials for note in trial.notes))
