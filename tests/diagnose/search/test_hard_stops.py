"""A travel that ends at stops which take the energy of what runs into them: named, with where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import said_of

INERTIA, FRICTION, TORQUE = 3e-5, 7.7e-4, 0.025
PROJECT = """schema = 1
name = "travel"
[recordings]
train = ["train.csv"]
[plant]
kind = "rotary_stage"
input = "voltage_V"
outputs = ["position_rad"]
[plant.parameters]
J_kg_m2 = { value = 3.5e-5, free = true }
b_N_m_s_rad = { value = 8e-4, free = true }
torque_per_unit = { value = 0.025, free = false }
"""


def _recorded(folder: Path, low: float, high: float) -> Path:
    rng, step, rows, fine = np.random.default_rng(5), 0.004, 900, 200
    drive = np.repeat([2.0, -2.0, 1.0, -1.0, 2.0, -1.0, -2.0, 2.0, -1.0, -2.0], rows // 10)
    place = speed = 0.0
    shown = np.zeros(rows)
    for row, volts in enumerate(drive):
        shown[row] = place
        for _ in range(fine):
            force = TORQUE * volts - FRICTION * speed
            if place > high:
                force -= max(5.0 * (place - high) + 0.012 * speed, 0.0)
            elif place < low:
                force += max(5.0 * (low - place) - 0.012 * speed, 0.0)
            speed += step / fine * force / INERTIA
            place += step / fine * speed
    table = np.column_stack([step * np.arange(rows), drive, shown + rng.normal(0.0, 0.01, rows)])
    np.savetxt(folder / "train.csv", table, delimiter=",", header="time_s,voltage_V,position_rad", comments="")
    (folder / "project.toml").write_text(PROJECT, encoding="utf-8")
    return folder / "project.toml"


@pytest.mark.parametrize(
    ("low", "high", "name", "places"),
    [
        (-14.0, 11.0, "end_stops", {"low_rad": -14.0, "high_rad": 11.0}),
        pytest.param(-1e9, 9.0, "end_stop", {"position_rad": 9.0}, marks=pytest.mark.slow),
    ],
)
def test_hard_stops_are_named(tmp_path: Path, low: float, high: float, name: str, places: dict[str, float]) -> None:
    said = said_of(_recorded(tmp_path, low, high))
    (effect,) = said["effects"]
    assert (said["verdict"], effect["name"]) == ("explained", name)
    for key, place in places.items():
        assert effect["parameters"][key]["value"] == pytest.approx(place, abs=0.03)
