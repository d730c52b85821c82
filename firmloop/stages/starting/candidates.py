"""Propose plant kinds for guessed columns, each with values where its fit may begin."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from firmloop.identify.plants.first_values import motor_values, stage_values
from firmloop.identify.recordings.recording import Recording
from firmloop.project.first_text import FirstParameter
from firmloop.stages.starting.reading import integrates

_FAR = 0.1  # of an output's span: a level this far from zero is one of rest, not noise

Proposal = tuple[str, tuple[str, ...], tuple[FirstParameter, ...]]  # kind, outputs, parameters


def proposals(recording: Recording, drive: str, outputs: tuple[str, ...]) -> Iterator[Proposal]:
    """Yield what the plant may be, the kind that tells most first."""
    first = outputs[0]
    if drive == "voltage_V" and "current_A" in outputs and first in ("speed_rad_s", "position_rad"):
        yield from _motors(recording, outputs)
    if first in _STAGES:
        yield _stage(recording, drive, first)
    rests = _rests(recording, drive, first)
    for kind in ("first_order", "second_order"):
        for rest in rests:
            yield kind, (first,), rest


def _motors(recording: Recording, outputs: tuple[str, ...]) -> Iterator[Proposal]:
    """Propose a brushed motor; where the rows are too far apart for its inductance, one without."""
    columns = recording.columns
    speed = columns.get("speed_rad_s")
    if speed is None:
        speed = np.gradient(columns["position_rad"], recording.time)
    found = motor_values(recording.time, columns["voltage_V"], columns["current_A"], speed)
    known = "kt, J and b are told only in proportion: take kt from a data sheet; here it is about ke"
    told = {"kt_N_m_A": known, "L_H": "0 and free = false where the rows are too far apart for it"}
    free = {"kt_N_m_A": False}
    yield (
        "dc_motor",
        outputs,
        tuple(FirstParameter(name, value, free.get(name, True), told.get(name, "")) for name, value in found.items()),
    )
    quick = {**found, "L_H": 0.0}
    yield (
        "dc_motor",
        outputs,
        tuple(
            FirstParameter(name, value, name not in ("kt_N_m_A", "L_H"), told.get(name, ""))
            for name, value in quick.items()
        ),
    )


_STAGES = {  # by the position: kind, its drive, its inertia, its friction, what turns another drive into its own
    "position_rad": ("rotary_stage", "torque_N_m", "J_kg_m2", "b_N_m_s_rad", "torque_per_unit"),
    "position_m": ("linear_stage", "force_N", "mass_kg", "b_N_s_m", "force_per_unit"),
}


def _stage(recording: Recording, drive: str, output: str) -> Proposal:
    """Propose a body on a bearing or a guide; behind a drive signal only ratios can be told, so its inertia is 1."""
    kind, own, inertia, friction, per_unit = _STAGES[output]
    pushed, slowed = stage_values(recording.time, recording.columns[drive], recording.columns[output])
    if drive == own:
        body = 1.0 / abs(pushed)
        return kind, (output,), (FirstParameter(inertia, body, True), FirstParameter(friction, slowed * body, True))
    return (
        kind,
        (output,),
        (
            FirstParameter(
                inertia, 1.0, False, "only ratios can be told behind a drive signal: give it if you know it"
            ),
            FirstParameter(friction, slowed, True),
            FirstParameter(per_unit, pushed, True),
        ),
    )


def _rests(recording: Recording, drive: str, output: str) -> list[tuple[FirstParameter, ...]]:
    """Return the levels that a lag may rest at; its other values are found without a start.

    The first row may hold the plant where it is, as 4 mA hold a valve shut, or be the first step of a plant that rests
    with its input at zero.
    """
    values, pushes = recording.columns[output], recording.columns[drive]
    held = (FirstParameter("output_at_rest", float(values[0]), True, "where the output rests"),)
    push = FirstParameter("input_at_rest", float(pushes[0]), False, "the input that holds it there")
    near = abs(float(values[0])) < _FAR * float(np.ptp(values))
    if not push.value:
        return [()] if near else [held]
    if near:  # what sums up has no level to rest at
        return [()] if integrates(pushes, values) else [(), (*held, push)]
    return [(*held, push), held]
