"""Close the loop of a law and a plant on paper."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from firmloop.design.analysis.loop import (
    Margins,
    Trajectory,
    closed_loop,
    margins,
    samples_to_rest,
    settles,
    slowest_lag,
    step_profile,
)
from firmloop.design.analysis.small_signal import NeverFreeError
from firmloop.design.analysis.step_metrics import StepMetrics, step_metrics
from firmloop.design.analysis.uncertainty import figures_of, half_widths
from firmloop.design.design import Design
from firmloop.design.law import DesignError, Horizon
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import Linear, bends, linearize
from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.quantize.twins.qp import optimum
from firmloop.stages.bode import Bode, bode
from firmloop.stages.plant import located
from firmloop.stages.reachable import Beyond, beyond_reach, explained

MOVED = 1e-9  # of a step
NO_METRICS = StepMetrics(*[math.nan] * 8)  # of a loop that runs away


@dataclass(frozen=True, slots=True)
class Loop:
    """How a law and a plant get on with each other."""

    margins: Margins
    step: Trajectory
    metrics: StepMetrics
    halves: Mapping[str, float]  # of 95 % intervals of both, by field, from those of the plant's parameters
    to_rest: float  # s that a step takes to rest, which may be more than `step` follows
    points: tuple[tuple[str, Margins], ...]  # at each operating point, where the controller has several
    bode: Bode | None = None
    beyond: Beyond | None = None  # a reference that the actuator cannot hold the plant at
    near_rest: str = ""  # why all of this holds near states and inputs of 0 alone


def analyze(project: Project, designed: Design, plant: Plant) -> Loop | None:
    """Close the loop on paper: margins, and a step of the reference.

    None where the controller has no single reference, or follows the plant's own equations, which are not linear.
    """
    if not _has_a_loop(designed):
        return None
    with located(project):
        linear = linearize(plant)
        try:
            return _closed(designed, plant, linear)
        except NeverFreeError as error:
            raise explained(error, designed.law.inputs, designed.law.outputs, plant, linear) from None


def _closed(designed: Design, plant: Plant, linear: Linear) -> Loop:
    law, profile = designed.law, step_profile(designed.law, linear)
    step, found = closed_loop(law, linear, profile, optimum), margins(designed.law, linear)
    lag = slowest_lag(law, linear)
    if not _moves(step):  # the actuator cannot drive the plant that way, as a fan cannot heat: step the other way
        other = closed_loop(law, linear, -profile, optimum)
        profile, step = (-profile, other) if _moves(other) else (profile, step)

    def figures(moved: Linear) -> Mapping[str, float]:
        searching = law.solve is not None  # which takes seconds
        measured = () if searching or not found.stable else (step_metrics(closed_loop(law, moved, profile), lag),)
        return figures_of(margins(law, moved), *measured)

    points = tuple((one.says, margins(one.law, linearize(one.plant))) for one in designed.operating)
    metrics = step_metrics(step, lag) if found.stable else NO_METRICS
    to_rest = samples_to_rest(law, linear) * law.period if found.stable else 0.0
    followed = bode(law, plant, found.crossover_rad_s)
    beyond = beyond_reach(law.inputs, law.outputs, plant, linear)
    return Loop(found, step, metrics, half_widths(plant, figures), to_rest, points, followed, beyond, near_rest(plant))


def near_rest(plant: Plant) -> str:
    """Say what a linear judgement of a plant rests on that is not linear; blank where it is."""
    bent = bends(plant)
    return bent and (
        f"the equation of {bent} is not linear, and gains and margins rest on its slopes with states and inputs at 0; "
        "for a loop that works elsewhere, write the plant in deviations from there"
    )


def runs_away(project: Project, designed: Design, plant: Plant | None) -> tuple[bool, str]:
    """Tell whether the loop around the plant is surely unstable, and why that cannot be told; blank where it can.

    Not where `analyze` has nothing to close.
    """
    if plant is None or not _has_a_loop(designed):
        return False, ""
    try:
        with located(project):
            away = not settles(designed.law, linearize(plant))
            return away, "" if away else near_rest(plant)
    except (DesignError, IdentifyError, ProjectError) as error:
        return False, str(error)


def _has_a_loop(designed: Design) -> bool:
    solve = designed.law.solve
    follows = solve is not None and isinstance(solve.problem, Horizon)
    return len(designed.law.inputs) > 1 and designed.law.paired and not follows


def _moves(step: Trajectory) -> bool:
    return bool(np.ptp(step.measurement) > MOVED * abs(step.reference[-1]))
