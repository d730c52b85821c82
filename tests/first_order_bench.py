"""A recording of a first-order plant and a project that begins elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording, write_recording
from firmloop.identify.simulation.simulate import simulate

Array = NDArray[np.float64]


def answered(time: Array, drive: tuple[str, Array], true: Mapping[str, float], start: float = 0.0) -> Array:
    """Return the temperature (n,) that a plant of these values gives."""
    name, values = drive
    plant = make_plant("first_order", name, ["temperature_C"], {key: {"value": value} for key, value in true.items()})
    empty = {name: values, "temperature_C": np.zeros(len(time))}
    return simulate(plant, make_recording(time, empty, "log.csv", ""), np.array([start]))[:, 0]


def leave(folder: Path, time: Array, drive: tuple[str, Array], seen: Array, parameters: str) -> Path:
    """Leave log.csv and a project with these [plant.parameters]; return the project file."""
    name, values = drive
    write_recording(make_recording(time, {name: values, "temperature_C": seen}, "log.csv", ""), folder / "log.csv")
    path = folder / "project.toml"
    path.write_text(f"""schema = 1
name = "bench"
[recordings]
train = ["log.csv"]
[plant]
kind = "first_order"
input = "{name}"
outputs = ["temperature_C"]
[plant.parameters]
{parameters}""")
    return path
