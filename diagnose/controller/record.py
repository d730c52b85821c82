"""Arrange a closed-loop recording as its controller saw it: what it was given and what it answered, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.diagnose.policy import (
    COUNTED_DIGITS,
    FEWEST_CONVERTER_STEPS,
    FEWEST_ROWS,
    HELD_COMMAND,
    MOST_LEVELS,
    MOST_REPLAYED_ROWS,
    MOST_STRIDE,
    UNEVEN_STEP,
)
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.clock import breaks
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.units import ending_of
from firmloop.verify.replay import Controller

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LoopRecord:
    """Rows of a recording in which no row is missing.

    `inputs` (n, m) are the controller's in its order, within their ranges; `command` (n,) is what the recording says it
    answered. `digits` and `steps` are how finely inputs and command are written down, and how finely they are measured
    at all, (n, m + 1) with the command last. The command is seen to change every `stride` rows, from row `phase` on.
    """

    source: str
    time: Array  # (n,) s
    inputs: Array
    command: Array
    command_name: str
    row_s: float
    stride: int
    phase: int
    digits: Array
    steps: Array


def loop_of(plant: Plant, controller: Controller, recording: Recording) -> LoopRecord | str:
    """Return the loop that a recording holds, or why it holds none; an empty string where no reference is recorded."""
    names = _columns(plant, controller, recording)
    if isinstance(names, str):
        return names
    command = plant.inputs[0].name
    if command not in recording.columns:
        return ""
    rows = _longest(recording.time)
    if rows.stop - rows.start < FEWEST_ROWS:
        return f"{recording.source}: the longest stretch without a missing row has fewer than {FEWEST_ROWS} rows"
    low = np.array([signal.low for signal in controller.inputs])
    high = np.array([signal.high for signal in controller.inputs])
    inputs = np.column_stack([recording.columns[name][rows] for name in names])
    answered = recording.columns[command][rows]
    time = recording.time[rows]
    stride, phase = _stride(answered)
    whole = np.column_stack([inputs, answered])
    digits = np.column_stack([_digits(column) for column in whole.T])
    steps = np.maximum(digits, np.column_stack([_measured_step(column) for column in whole.T]))
    told = controller.wires[0]
    steps[:, told] = digits[:, told]  # a reference is not measured
    return LoopRecord(
        source=recording.source,
        time=time,
        inputs=np.clip(inputs, low, high),
        command=answered,
        command_name=command,
        row_s=float((time[-1] - time[0]) / (len(time) - 1)),
        stride=stride,
        phase=phase,
        digits=digits,
        steps=steps,
    )


def _columns(plant: Plant, controller: Controller, recording: Recording) -> list[str] | str:
    """Return the column of every input: by its own name, else by what it is for."""
    reference, measurement = controller.wires
    measured = plant.outputs[0].name
    names = []
    for index, signal in enumerate(controller.inputs):
        if signal.name in recording.columns:
            names.append(signal.name)
        elif index == measurement and measured in recording.columns:
            names.append(measured)
        elif index == reference:
            found = _reference(recording, measured)
            if found is None:
                return ""
            names.append(found)
        else:
            return f"{recording.source}: no column holds the controller's input {signal.name}"
    return names


def _reference(recording: Recording, measured: str) -> str | None:
    """Return the column `reference_*` that goes with the measured one, by name or by unit."""
    told = [name for name in recording.columns if name.startswith("reference")]
    exact = [name for name in told if name in (f"reference_{measured}", f"reference_{ending_of(measured)}")]
    alike = [name for name in told if ending_of(name) == ending_of(measured) or name == "reference"]
    found = exact[:1] or alike
    return found[0] if len(found) == 1 else None


def _longest(time: Array) -> slice:
    """Return the longest stretch of rows without a gap, at most MOST_REPLAYED_ROWS of it."""
    ends = [0, *breaks(time), len(time)]
    lengths = np.diff(ends)
    first = int(np.argmax(lengths))
    return slice(int(ends[first]), int(ends[first]) + min(int(lengths[first]), MOST_REPLAYED_ROWS))


def _stride(command: Array) -> tuple[int, int]:
    """Return every how many rows the command changes, and the first row in which it may."""
    changes = np.flatnonzero(np.diff(command) != 0.0) + 1
    if len(changes) < 20:
        return 1, 0
    for stride in range(min(MOST_STRIDE, len(command) // 20), 1, -1):
        counts = np.bincount(changes % stride, minlength=stride)
        if counts.max() >= HELD_COMMAND * len(changes):
            return stride, int(counts.argmax())
    return 1, 0


def _digits(values: Array) -> Array:
    """Return one unit of the last digit (n,) that the values are written with: decimals and significant figures.

    Values of which there are only a few are levels that somebody chose, and written down as they are.
    """
    if len(np.unique(values)) <= MOST_LEVELS:
        return np.zeros(len(values))
    some = [float(x) for x in values[:: max(len(values) // COUNTED_DIGITS, 1)]]
    decimals = next((d for d in range(16) if all(round(x, d) == x for x in some)), 17)
    figures = next((f for f in range(1, 17) if all(float(f"{x:.{f - 1}e}") == x for x in some)), 17)
    size = np.floor(np.log10(np.maximum(np.abs(values), 1e-12)))
    return np.maximum(10.0**-decimals, 10.0 ** (size + 1 - figures))


def _measured_step(values: Array) -> Array:
    """Return the smallest distance (n,) between two different values where all are multiples of it, else 0."""
    levels = np.unique(np.round(values, 12))
    apart = np.diff(levels)
    if len(apart) < FEWEST_CONVERTER_STEPS:
        return np.zeros(len(values))
    step = float(apart.min())
    counts = apart / step
    even = float(np.max(np.abs(counts - np.round(counts)))) < UNEVEN_STEP
    return np.full(len(values), step if even else 0.0)
