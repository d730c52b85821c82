"""A log of three bridges whose columns cannot be what their names say is refused before the fit."""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.bridge_columns import check_bridges

PAIRS, ROWS, STEP, SPEED = 4, 2000, 50e-6, 300.0
VALUES = {"R_ohm": 0.36, "Ld_H": 2e-4, "Lq_H": 3e-4, "flux_Wb": 6e-3, "J_kg_m2": 5e-6, "b_N_m_s_rad": 1e-5}
INPUTS = ("duty_a", "duty_b", "duty_c", "supply_V", "angle_rad")


def log() -> dict[str, np.ndarray]:
    time = np.arange(ROWS) * STEP
    speed = SPEED * np.sin(2 * math.pi * time / 0.1) ** 2
    shaft = np.cumsum(speed) * STEP
    wave = {f"duty_{x}": 0.5 + 0.2 * np.cos(PAIRS * shaft - k) for k, x in enumerate("abc")}
    angle = (PAIRS * shaft + math.pi) % (2 * math.pi) - math.pi
    return {**wave, "supply_V": np.full(ROWS, 24.0), "angle_rad": angle, "speed_rad_s": speed, "shaft": shaft}


def checked(columns: dict[str, np.ndarray]) -> None:
    plant = make_plant("pmsm", INPUTS, ["current_a_A", "current_b_A", "speed_rad_s"], {**VALUES, "pole_pairs": PAIRS})
    check_bridges(plant, [Recording(np.arange(ROWS) * STEP, MappingProxyType(columns), (), "log.csv", "")])


def test_a_sound_log_passes() -> None:
    checked(log())
    checked({**log(), "speed_rad_s": np.zeros(ROWS), "angle_rad": np.full(ROWS, 0.3)})


def test_a_machine_on_voltages_is_not_asked() -> None:
    plant = make_plant("pmsm", ("voltage_d_V", "voltage_q_V"), ["speed_rad_s"], {**VALUES, "pole_pairs": PAIRS})
    check_bridges(plant, [Recording(np.arange(2) * STEP, MappingProxyType({}), (), "log.csv", "")])


SOUND = log()
TURN = SOUND["angle_rad"]
WRONG = {
    "no supply": ({"supply_V": np.zeros(ROWS)}, "supply_V is 0 V in 2000 of 2000 rows, first at 0 s"),
    "a supply that goes": (
        {"supply_V": np.where(np.arange(ROWS) < 1500, 24.0, 0.0)},
        "supply_V is 0 V in 500 of 2000 rows, first at 0.075 s",
    ),
    "a supply turned around": ({"supply_V": np.full(ROWS, -24.0)}, "supply_V is -24 V in 2000 of 2000 rows"),
    "percent": ({"duty_a": 100 * SOUND["duty_a"]}, "it looks like percent; give the column scale = 0.01"),
    "timer": ({"duty_b": 4200 * SOUND["duty_b"]}, "it looks like counts of a timer"),
    "around 0": ({"duty_c": SOUND["duty_c"] - 0.5}, "it looks like one around 0; give the column offset = 0.5"),
    "degrees": ({"angle_rad": TURN * 180 / math.pi}, "it looks like degrees; write angle = "),
    "counts": ({"angle_rad": np.round(TURN * 4096 / 2 / math.pi)}, "it looks like counts, 409"),
    "turns": ({"angle_rad": TURN / 2 / math.pi}, "it looks like turns"),
    "the shaft": ({"angle_rad": SOUND["shaft"]}, "it looks like the angle of the shaft; give the column scale = 4"),
    "backwards": ({"angle_rad": -TURN}, "backwards; change the sign of one of the two"),
    "other pole pairs": ({"angle_rad": SOUND["shaft"] * 7}, "correct pole_pairs, which would be 7"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    changed, words = WRONG[case]
    with pytest.raises(IdentifyError) as refused:
        checked({**SOUND, **changed})
    assert words in str(refused.value) and "\n" not in str(refused.value)
