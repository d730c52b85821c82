"""What was left out of a fit tells of physics, not of what one kind of run cannot teach of another."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.diagnose.cases import black_box_project, said_of

STEP = 1e-3  # s
TRAIN = ("ramp.csv", "step.csv")
STAGE = (
    black_box_project("linear_stage", "voltage_V", "speed_m_s", TRAIN)
    + "force_per_unit = 58.6\n[plant.parameters]\n"
    + "mass_kg = { value = 20.0, free = true }\nb_N_s_m = { value = 60.0, free = true }\n"
)


def logged(folder: Path) -> Path:
    """Log a slow ramp and a step back of a stage with 42.5 N of friction, whose speed is read 50 ms late."""
    random = np.random.default_rng(0)
    for name, volts in zip(TRAIN, (0.85 * STEP * np.arange(9000.0), np.full(2200, -6.0)), strict=True):
        speed, shown, seen = 0.0, 0.0, np.empty(len(volts))
        for k, volt in enumerate(np.repeat(volts[::5], 5)):
            seen[k] = shown
            shown += STEP * (speed - shown) / 0.05
            free = 58.6 * volt - 72.5 * speed
            if speed == 0.0 and abs(free) <= 42.5:
                continue
            way = np.sign(speed) if speed else np.sign(free)
            after = speed + STEP * (free - 42.5 * way) / 14.2
            speed = 0.0 if speed * after < 0.0 else after
        read = seen[::5] + 0.08 * random.normal(size=len(seen[::5]))
        table = np.column_stack([STEP * np.arange(len(volts))[::5], volts[::5], read])
        np.savetxt(folder / name, table, delimiter=",", header="time_s,voltage_V,speed_m_s", comments="")
    (folder / "project.toml").write_text(STAGE, encoding="utf-8")
    return folder / "project.toml"


def test_a_ramp_one_way_and_a_step_the_other_foresee_what_is_left_out_of_both(tmp_path: Path) -> None:
    said = said_of(logged(tmp_path))
    assert {each["name"] for each in said["effects"]} == {"dead_zone", "coulomb_friction", "sensor_lag"}
    left_out = said["simulation_rms"]["cross"]["speed_m_s"]
    assert left_out["after"] < 0.085 < 0.2 < left_out["refit"]  # a step of one size cannot tell friction from gain
