"""A step that begins with its recording, from rest: no hidden current answers for what is missing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import said_of

PROJECT = """schema = 1
name = "steps_from_rest"
[recordings]
train = ["4.csv", "8.csv", "12.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
R_ohm = { value = 1.6, free = false }
L_H = { value = 1e-3, free = true }
ke_V_s_rad = { value = 0.044, free = true }
kt_N_m_A = { value = 0.045, free = false }
J_kg_m2 = { value = 1e-4, free = true }
b_N_m_s_rad = { value = 2e-5, free = true }
"""
STEP_S, ROWS, FINER = 4e-3, 250, 200


def _recorded(folder: Path, friction: float, late: int) -> Path:
    """Switch a motor on at three voltages in the first row; its command comes `late` rows later."""
    rng = np.random.default_rng(5)
    for level in (4.0, 8.0, 12.0):
        current, speed, read = 0.0, 0.0, np.zeros(ROWS)
        for row in range(ROWS):
            read[row] = speed
            for _ in range(FINER):
                volts = level if row >= late else 0.0
                current += STEP_S / FINER * (volts - 1.6 * current - 0.045 * speed) / 0.9e-3
                pull = 0.045 * current - 2e-5 * speed
                speed += STEP_S / FINER * np.sign(pull) * max(abs(pull) - friction, 0.0) / 9e-5
        columns = [STEP_S * np.arange(ROWS), np.full(ROWS, level), read + rng.normal(0.0, 0.3, ROWS)]
        header = "time_s,voltage_V,speed_rad_s"
        np.savetxt(folder / f"{level:g}.csv", np.column_stack(columns), delimiter=",", header=header, comments="")
    (folder / "project.toml").write_text(PROJECT, encoding="utf-8")
    return folder / "project.toml"


@pytest.mark.parametrize(
    ("friction", "late", "verdict", "among"),
    [
        pytest.param(0.0, 0, "no_mismatch", "", id="nothing is missing"),
        pytest.param(0.004, 0, "ambiguous", "coulomb_friction load_torque dead_zone", id="dry friction"),
        pytest.param(0.0, 5, "ambiguous", "input_delay sensor_delay", id="a command that comes late"),
    ],
)
def test_a_step_at_the_first_row(friction: float, late: int, verdict: str, among: str, tmp_path: Path) -> None:
    said = said_of(_recorded(tmp_path, friction, late))
    assert said["verdict"] == verdict
    assert {each["name"] for each in said["effects"]} >= set(among.split())
    assert not any("by itself" in note for note in said["notes"])
