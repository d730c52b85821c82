"""A swing that dies out by itself tells its friction; nothing drives it that would tell how large a force is usual."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.diagnose.cases import said_of

INERTIA = 0.01  # kg m^2
PROJECT = """schema = 1
name = "swing"
[recordings]
train = ["swing.csv"]
[plant]
kind = "ode"
states = ["angle_rad", "speed_rad_s"]
inputs = ["torque_N_m"]
[plant.outputs]
angle_rad = "angle_rad"
[plant.derivatives]
angle_rad = "speed_rad_s"
speed_rad_s = "(torque_N_m - k_N_m_rad*{pulled} - d_N_m_s_rad*speed_rad_s)/J_kg_m2"
[plant.balances]
speed_rad_s = {{ kind = "torque", per = "1/J_kg_m2", position = "angle_rad", effort = "torque_N_m" }}
[plant.parameters]
J_kg_m2 = {{ value = 0.01, free = false }}
k_N_m_rad = {{ value = {stiffness}, free = true }}
d_N_m_s_rad = {{ value = {damping}, free = true }}
"""


def _swing(
    folder: Path,
    stiffness: float,
    friction: float,
    pendulum: bool,
    rows: int,
    step: float,
    angle: float = 0.7,
    viscous: float = 2e-3,
) -> Path:
    """Leave a swing from an angle with a viscous torque (N m s/rad) and a dry one (N m), by steps of 1/40 row."""
    rng, speed, read = np.random.default_rng(9), 0.0, []
    for _ in range(rows):
        read.append(angle + rng.normal(0.0, 1e-3))
        for _ in range(40):
            pulled = stiffness * (np.sin(angle) if pendulum else angle)
            speed -= step / 40 / INERTIA * (pulled + viscous * speed + friction * np.tanh(speed / 3e-3))
            angle += step / 40 * speed
    table = np.column_stack([step * np.arange(rows), np.zeros(rows), read])
    head = "time_s,torque_N_m,angle_rad"
    np.savetxt(folder / "swing.csv", table, delimiter=",", header=head, comments="", fmt="%.5f")
    pulled = "sin(angle_rad)" if pendulum else "angle_rad"
    text = PROJECT.format(pulled=pulled, stiffness=0.92 * stiffness, damping=0.7 * viscous)
    (folder / "project.toml").write_text(text, encoding="utf-8")
    return folder / "project.toml"


@pytest.mark.parametrize(
    ("stiffness", "friction", "pendulum", "rows", "step"),
    [
        pytest.param(0.9, 6e-3, False, 800, 0.005, id="on a spring: it had come out as noise"),
        pytest.param(0.327, 2.5e-3, True, 900, 0.01, id="of a pendulum: unknown", marks=pytest.mark.slow),
        pytest.param(0.327, 0.0, True, 600, 0.01, id="with none", marks=pytest.mark.slow),
    ],
)
def test_a_free_swing_tells_its_dry_friction(
    stiffness: float, friction: float, pendulum: bool, rows: int, step: float, tmp_path: Path
) -> None:
    said = said_of(_swing(tmp_path, stiffness, friction, pendulum, rows, step))
    assert [each["name"] for each in said["effects"]] == (["coulomb_friction"] if friction else []), said["says"]
    assert said["verdict"] == ("explained" if friction else "no_mismatch")
    if friction:
        assert said["effects"][0]["parameters"]["torque_N_m"]["value"] == pytest.approx(friction, rel=0.02)


@pytest.mark.parametrize(("angle", "rows"), [(2.3, 800), (1.2, 600)], ids=["far: a cogging", "near: no mismatch"])
def test_a_friction_far_below_what_turns_a_swing_round_is_told(angle: float, rows: int, tmp_path: Path) -> None:
    """Two hundredths of what pulls it back: a fit began at many times that, where the swing stood still at once."""
    said = said_of(_swing(tmp_path, 0.3, 1.35e-3, True, rows, 0.02, angle, 2.6e-4))
    assert [each["name"] for each in said["effects"]] == ["coulomb_friction"], said["says"]
    assert said["effects"][0]["parameters"]["torque_N_m"]["value"] == pytest.approx(1.35e-3, rel=0.02)
