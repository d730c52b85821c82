"""Make recordings of a fleet of small motors: most alike but for their tolerances, some with one of five faults."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROWS, ROW_S, SUBSTEPS = 500, 0.002, 40
NOMINAL = {"R": 7.4, "L": 1.1e-3, "ke": 0.0213, "kt": 0.0213, "J": 3.3e-6, "b": 3.6e-6, "dry": 0.0, "dead": 0.0}
SCATTER = {"R": 0.02, "magnet": 0.015, "J": 0.02, "b": 0.1}  # one standard deviation, relative
SPEED_NOISE, CURRENT_NOISE = 0.4, 0.008  # rad/s, A
# What is wrong, what it does to a healthy motor, and by which of these names it is found.
FAULTS: Mapping[str, tuple[Mapping[str, float], tuple[str, ...]]] = {
    "hot winding": ({"R*": 1.25}, ("R_ohm",)),
    "weak magnets": ({"ke*": 0.88, "kt*": 0.88}, ("ke_V_s_rad",)),
    "dry bearing": ({"dry": 6e-4}, ("coulomb_friction", "asymmetric_friction", "stribeck_friction")),
    "added inertia": ({"J*": 1.25}, ("J_kg_m2",)),
    "dead zone of the driver": ({"dead": 0.5}, ("dead_zone", "brush_drop")),
}
PROJECT = """\
schema = 1
name = "fleet_motor"

[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s", "current_A"]
[plant.parameters]
R_ohm = { value = 7.4, free = true }
L_H = { value = 1.1e-3, free = false }
ke_V_s_rad = { value = 0.0213, free = true }
kt_N_m_A = { value = 0.0213, free = false }
J_kg_m2 = { value = 3.3e-6, free = true }
b_N_m_s_rad = { value = 3.6e-6, free = true }
"""


@dataclass(frozen=True, slots=True)
class Fleet:
    """The constants of every motor, by name (n,), and what is wrong with each; empty where nothing is."""

    constants: Mapping[str, Array]
    faults: tuple[str, ...]


def make_fleet(count: int, faulty: int, seed: int) -> Fleet:
    """Draw the motors; the faults go around, to motors that are drawn as well."""
    random = np.random.default_rng(seed)
    made = {name: np.full(count, value) for name, value in NOMINAL.items()}
    drawn = {name: 1.0 + size * random.standard_normal(count) for name, size in SCATTER.items()}
    for name, factor in (("R", "R"), ("ke", "magnet"), ("kt", "magnet"), ("J", "J"), ("b", "b")):
        made[name] *= drawn[factor]
    faults = [""] * count
    for k, place in enumerate(random.permutation(count)[:faulty]):
        fault = list(FAULTS)[k % len(FAULTS)]
        faults[place] = fault
        for name, change in FAULTS[fault][0].items():
            constant = made[name.removesuffix("*")]
            constant[place] = constant[place] * change if name.endswith("*") else change
    return Fleet(made, tuple(faults))


def simulate(fleet: Fleet, seed: int) -> tuple[Array, Array, Array]:
    """Return voltage, speed and current (rows, motors) as they are read; every motor has voltages of its own."""
    random, of = np.random.default_rng(seed + 1), fleet.constants
    count, step = len(fleet.faults), ROW_S / SUBSTEPS
    voltage = np.repeat(random.uniform(-12.0, 12.0, (ROWS // 25, count)), 25, axis=0)
    current, speed = np.zeros(count), np.zeros(count)
    read = np.empty((2, ROWS, count))
    for row in range(ROWS):
        read[:, row] = speed, current
        drive = np.sign(voltage[row]) * np.maximum(np.abs(voltage[row]) - of["dead"], 0.0)
        for _ in range(SUBSTEPS):
            # The winding is settled within a substep: taken implicitly, so that it is stable.
            current = (current + step / of["L"] * (drive - of["ke"] * speed)) / (1.0 + step * of["R"] / of["L"])
            pushed = speed + step / of["J"] * (of["kt"] * current - of["b"] * speed)
            held = step / of["J"] * of["dry"]
            speed = np.where(np.abs(pushed) <= held, 0.0, pushed - held * np.sign(pushed))
    noise = random.standard_normal(read.shape)
    return voltage, read[0] + SPEED_NOISE * noise[0], read[1] + CURRENT_NOISE * noise[1]


def write_fleet(folder: Path, fleet: Fleet, seed: int) -> Path:
    """Write a recording a motor into `folder`/recordings and the project beside it; return the project."""
    voltage, speed, current = simulate(fleet, seed)
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    for k in range(len(fleet.faults)):
        with (folder / "recordings" / f"m{k:03}.csv").open("w", newline="", encoding="utf-8") as stream:
            rows = csv.writer(stream, lineterminator="\n")
            rows.writerow(("time_s", "voltage_V", "speed_rad_s", "current_A"))
            for row in range(ROWS):
                seen = (voltage[row, k], speed[row, k], current[row, k])
                rows.writerow((f"{row * ROW_S:.3f}", *(f"{value:.6g}" for value in seen)))
    project = folder / "fleet_motor.toml"
    project.write_text(PROJECT, encoding="utf-8")
    return project
