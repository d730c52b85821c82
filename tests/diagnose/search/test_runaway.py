"""A refit that leaves a motion altogether, as of a shaft too heavy to turn, has run away from what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from tests.diagnose.cases import diagnosis, logged


class Sprung(NamedTuple):
    """A motor whose shaft swings on a spring; the inertia and friction of the project are somewhat off."""

    resistance: float
    inductance: float
    torque_constant: float
    inertia: float
    friction: float
    stiffness: float  # N m/rad
    told: tuple[float, float, float]  # ke, J and b as given


MOTORS = (
    Sprung(1.82, 0.0019, 0.068, 4.17e-4, 6.4e-5, 0.27, (0.073, 4.1e-4, 6.9e-5)),
    Sprung(4.83, 0.019, 0.0542, 1.03e-4, 2.83e-5, 0.0778, (0.05305, 1.062e-4, 2.91e-5)),
)
PROJECT = """schema = 1
name = "sprung"
[recordings]
train = ["log.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
R_ohm = {{ value = {0.resistance}, free = false }}
L_H = {{ value = {0.inductance}, free = false }}
ke_V_s_rad = {{ value = {0.told[0]}, free = true }}
kt_N_m_A = {{ value = {0.torque_constant}, free = false }}
J_kg_m2 = {{ value = {0.told[1]}, free = true }}
b_N_m_s_rad = {{ value = {0.told[2]}, free = true }}
"""


@pytest.mark.parametrize("motor", MOTORS)
def test_a_spring_that_the_shaft_swings_on_is_found_by_its_speed_alone(motor: Sprung, tmp_path: Path) -> None:
    """It had been a coupling to a second body ten thousand times as heavy, or a hardening spring and a cogging."""
    rng, rows, step, fine = np.random.default_rng(0), 1600, 1e-3, 20
    drive = np.repeat(rng.uniform(-12.0, 12.0, rows // 100 + 1), 100)[:rows]
    drive[:10] = 0.0
    current = speed = angle = 0.0
    read = np.empty(rows)
    for k in range(rows):
        read[k] = speed
        for _ in range(fine):
            rise = (drive[k] - motor.resistance * current - motor.torque_constant * speed) / motor.inductance
            push = motor.torque_constant * current - motor.friction * speed - motor.stiffness * angle
            current += step / fine * rise
            speed += step / fine * push / motor.inertia
            angle += step / fine * speed
    noisy = read + 0.3 * rng.normal(size=rows)
    head = "time_s,voltage_V,speed_rad_s"
    project = logged(tmp_path, PROJECT.format(motor), head, step * np.arange(rows), drive, noisy)
    _, said = diagnosis(project, tmp_path / "out")
    assert [each["name"] for each in said["effects"]] == ["return_spring"], said["says"]
    stiffness = said["effects"][0]["parameters"]["stiffness_N_m_rad"]["value"]
    assert stiffness == pytest.approx(motor.stiffness, rel=0.02)
