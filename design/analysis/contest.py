"""Tune one loop by every rule, and measure all of them alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from firmloop.design.analysis.loop import (
    Margins,
    Trajectory,
    closed_loop,
    disturbed_loop,
    margins,
    noise_gain,
    slowest_lag,
    step_profile,
)
from firmloop.design.analysis.step_metrics import StepMetrics, step_metrics
from firmloop.design.analysis.uncertainty import figures_of, half_widths
from firmloop.design.design import Design, Request, check_signals
from firmloop.design.kinds.pid.kind import GAIN_KEYS, find_wires, room
from firmloop.design.kinds.pid.kind import KEYS as PID_KEYS
from firmloop.design.kinds.pid.kind import design as design_pid
from firmloop.design.law import DesignError
from firmloop.design.roles import reference_and_measurement
from firmloop.design.table import real
from firmloop.design.tuning import rules
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import Linear, linearize

Array = npt.NDArray[np.float64]

SETTLED = 0.05  # share of the peak within which a load disturbance counts as gone


@dataclass(frozen=True, slots=True)
class LoadMetrics:
    """Figures of the answer to a step of the load at the plant's input, from rest."""

    peak: float  # furthest from the reference, unit of the measurement
    recovery_s: float  # until 5 % of the peak is never left again; infinite where that is not reached
    iae: float  # unit of the measurement times s


@dataclass(frozen=True, slots=True)
class Unreached:
    """A step of `size` that the output's limit ends at `end`, both in `unit`: its figures are of what comes."""

    size: float
    end: float
    unit: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One rule and its loop; `refused` says why the rule cannot tune this plant, and then there is nothing else."""

    rule: str
    refused: str
    design: Design | None = None
    margins: Margins | None = None
    step: StepMetrics | None = None
    load: LoadMetrics | None = None
    noise_gain: float = math.nan  # rms of the output over rms of white noise on the measurement
    halves: Mapping[str, float] = field(default_factory=dict)  # of 95 % intervals by figure, from the plant's
    about: float = 0.0  # the output's value that all is measured about, its unit
    unreached: Unreached | None = None  # where a limit keeps the step from its reference


def contest(request: Request, names: Sequence[str], own: Mapping[str, Mapping[str, object]]) -> tuple[Entry, ...]:
    """Tune `request`, a pid's, by each rule of `names`; `own` holds keys for single rules.

    Every loop is measured over the same stretch of time, that of the slowest stable one. The load is an eighth of the
    output's range. An output that cannot go both ways from 0 is measured from the middle of its range, where the loop
    is taken to work.

    Raises
    ------
    DesignError
        when the table or a rule's keys are wrong, or there is no plant.
    """
    plant = request.plant
    if plant is None:
        raise DesignError("a comparison of tuning rules needs a plant; add [plant]")
    linear = linearize(plant)
    check_signals(request)
    request, about = _about_its_middle(request)
    wires = find_wires(request)
    told = {key: value for key, value in request.table.items() if key in PID_KEYS and key not in GAIN_KEYS}
    for key in ("tune", "ti_s", "td_s", "tt_s"):
        told.pop(key, None)
    if told.get("form") in ("ideal", "series"):
        told["form"] = "default"
    made: list[Entry] = []
    for name in names:
        shared = {key: value for key, value in request.table.items() if key in rules()[name].keys}
        table = {**told, **shared, **own.get(name, {}), "tune": name}
        try:
            made.append(Entry(name, "", design_pid(replace(request, table=table)), about=about))
        except DesignError as error:
            if str(error).startswith("controller."):
                raise
            made.append(Entry(name, str(error)))
    found = [_margins(entry, linear) for entry in made]
    samples = max((len(step_profile(e.design.law, linear)) for e in found if _stable(e) and e.design), default=0)
    limits = room(wires)
    load = (limits["u_max"] - limits["u_min"]) / 8
    return tuple(_measured(entry, plant, linear, samples, load) if _stable(entry) else entry for entry in found)


def _about_its_middle(request: Request) -> tuple[Request, float]:
    output = find_wires(request).output
    low = real(request.table, "u_min", output.low)
    high = real(request.table, "u_max", output.high)
    if low < 0 < high:
        return request, 0.0
    middle = (low + high) / 2
    moved = replace(output, low=low - middle, high=high - middle)
    limits = {"u_min": low - middle, "u_max": high - middle}
    table = {key: limits.get(key, value) for key, value in request.table.items()}
    outputs = tuple(moved if wire is output else wire for wire in request.outputs)
    return replace(request, table=table, outputs=outputs), middle


def _stable(entry: Entry) -> bool:
    return entry.margins is not None and entry.margins.stable


def _margins(entry: Entry, linear: Linear) -> Entry:
    if entry.design is None:
        return entry
    return replace(entry, margins=margins(entry.design.law, linear))


def _measured(entry: Entry, plant: Plant, linear: Linear, samples: int, load: float) -> Entry:
    assert entry.design is not None
    law = entry.design.law
    reference = np.full(samples, step_profile(law, linear)[0])
    pushes, lag = (np.zeros(samples), np.full(samples, load)), slowest_lag(law, linear)

    def measured(moved: Linear) -> tuple[Trajectory, LoadMetrics, float]:
        stepped, pushed = closed_loop(law, moved, reference), disturbed_loop(law, moved, *pushes)
        return stepped, load_metrics(pushed), noise_gain(law, moved)

    def figures(moved: Linear) -> Mapping[str, float]:
        step, pushed, noise = measured(moved)
        answer = {f"load_{name}": value for name, value in figures_of(pushed).items()}
        return {**figures_of(margins(law, moved), step_metrics(step, lag)), **answer, "noise_gain": noise}

    step, pushed, noise = measured(linear)
    halves = half_widths(plant, figures)
    made = replace(entry, step=step_metrics(step, lag), load=pushed, noise_gain=noise, halves=halves)
    if not step.held_back:
        return made
    unit = law.inputs[reference_and_measurement(law.inputs)[1]].unit
    return replace(made, unreached=Unreached(float(step.reference[-1]), float(step.measurement[-1]), unit))


def load_metrics(trajectory: Trajectory) -> LoadMetrics:
    """Measure how a load disturbance that begins with the trajectory passes."""
    error = np.abs(trajectory.reference - trajectory.measurement)
    peak = float(error.max())
    outside = np.flatnonzero(error > SETTLED * peak)
    last = int(outside[-1]) + 1 if len(outside) else 0
    recovery = math.inf if last > 0.95 * len(error) else float(trajectory.time[last])
    return LoadMetrics(peak, recovery, float(np.sum(error)) * float(trajectory.time[1] - trajectory.time[0]))
