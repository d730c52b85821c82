"""What a feedforward is worth: the loop closed against the plant with all its effects, with and without it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Design
from firmloop.design.kinds import design as design_law
from firmloop.design.models.feedforward import position_of
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.stepped import with_place
from firmloop.project.project import Project
from firmloop.project.project_text import settled
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.twins.qp import optimum
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.closed_loop import LoopRun, PlantLoop, close_loop

Array = NDArray[np.float64]

ROUND = 1000  # steps of one wave of the reference
ROUNDS = 2  # the last one is judged
SHARE = 8.0  # of the reference's range is the wave's amplitude


@dataclass(frozen=True, slots=True)
class TrackedRun:
    """One run of the C against the plant, and the error of its last wave: root of the mean square, and largest."""

    measurement: Array
    command: Array
    rms: float
    worst: float


@dataclass(frozen=True, slots=True)
class Tracking:
    """A slow wave of the reference, followed without and with the feedforward; all arrays one value a step."""

    period: float  # s
    unit: str
    reference: Array
    without: TrackedRun
    beside: TrackedRun  # with it

    def as_dict(self) -> dict[str, object]:
        """Return what `--json` says."""
        return {
            "steps": len(self.reference),
            "unit": self.unit,
            "without_feedforward": {"rms": self.without.rms, "worst": self.without.worst},
            "with_feedforward": {"rms": self.beside.rms, "worst": self.beside.worst},
        }


def tracking(project: Project, designed: Design, program: Program, plant: Plant | None) -> Tracking | None:
    """Follow a wave with the C on this machine; None where there is no feedforward, or nothing to follow or to drive.

    Raises ToolError where this machine has no compiler.
    """
    part, law = project.controller, designed.law
    if part is None or plant is None or "feedforward" not in part.settings or len(law.inputs) < 2:
        return None
    position = position_of(part.settings)
    table = {key: value for key, value in settled(part.settings, designed).items() if key != "feedforward"}
    inputs = tuple(wire for wire in law.inputs if wire.name != position)
    bare = design_law(part.kind, project.name, table, part.period, inputs, law.outputs, plant, optimum).law
    if designed.bench is not None:
        told = next(wire for wire in law.inputs if wire.name == designed.bench.told)
        loop = PlantLoop(designed.bench.plant, _wave(told), (told.name, ""), designed.bench.read_by(law.inputs))
        loops = (loop, loop)
    else:
        told, measurement = (law.inputs[k] for k in reference_and_measurement(law.inputs))
        driven, place = with_place(plant) if position is not None else (plant, -1)
        loop = PlantLoop(driven, _wave(told), (told.name, measurement.name))
        loops = loop, replace(loop, others=((position, place),) if position is not None else ())
    if not math.isfinite(told.high - told.low):
        return None
    runs = [_run(built, each) for built, each in zip((lower(bare, program.arithmetic), program), loops, strict=True)]
    if any(len(run.reference) < len(loop.reference) for run in runs):
        return None
    return Tracking(law.period, told.unit, loop.reference, *(_course(run) for run in runs))


def _wave(told: Signal) -> Array:
    turn = 2.0 * math.pi * np.arange(ROUND * ROUNDS) / ROUND
    return np.asarray((told.low + told.high) / 2.0 + (told.high - told.low) / SHARE * np.sin(turn))


def _run(program: Program, loop: PlantLoop) -> LoopRun:
    link = LibraryLink(build_host(emit(program, "firmloop"), load_target("host")), program)
    return close_loop(program, loop, link)


def _course(run: LoopRun) -> TrackedRun:
    error = (run.reference - run.measurement)[-ROUND:]
    return TrackedRun(run.measurement, run.command, float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))))
