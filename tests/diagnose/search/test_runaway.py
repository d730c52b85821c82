"""A refit that leaves a motion altogether, as of a shaft too heavy to turn, has run away from what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import diagnosis

STIFFNESS = 0.27  # N m/rad
PROJECT = """schema = 1
name = "sprung"
[recordings]
train = ["log.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
R_ohm = { value = 1.82, free = false }
L_H = { value = 0.0019, free = false }
ke_V_s_rad = { value = 0.073, free = true }
kt_N_m_A = { value = 0.068, free = false }
J_kg_m2 = { value = 4.1e-4, free = true }
b_N_m_s_rad = { value = 6.9e-5, free = true }
"""


def test_a_spring_that_the_shaft_swings_on_is_found_by_its_speed_alone(tmp_path: Path) -> None:
    """It had been a coupling to a second body ten thousand times as heavy."""
    rng, rows, step, fine = np.random.default_rng(0), 1600, 1e-3, 20
    drive = np.repeat(rng.uniform(-12.0, 12.0, rows // 100 + 1), 100)[:rows]
    drive[:10] = 0.0
    current = speed = angle = 0.0
    read = np.empty(rows)
    for k in range(rows):
        read[k] = speed
        for _ in range(fine):
            rise = (drive[k] - 1.82 * current - 0.068 * speed) / 0.0019
            push = (0.068 * current - 6.4e-5 * speed - STIFFNESS * angle) / 4.17e-4
            current += step / fine * rise
            speed += step / fine * push
            angle += step / fine * speed
    table = np.column_stack([step * np.arange(rows), drive, read + 0.3 * rng.normal(size=rows)])
    head = "time_s,voltage_V,speed_rad_s"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=head, comments="", fmt="%.6g")
    (tmp_path / "project.toml").write_text(PROJECT, encoding="utf-8")
    _, said = diagnosis(tmp_path / "project.toml", tmp_path / "out")
    assert [each["name"] for each in said["effects"]] == ["return_spring"], said["says"]
    stiffness = said["effects"][0]["parameters"]["stiffness_N_m_rad"]["value"]
    assert stiffness == pytest.approx(STIFFNESS, rel=0.02)
