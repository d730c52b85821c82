"""A parameter of the plant or of an effect that ends far from its given value is said; the start of a lag is not."""

from __future__ import annotations

import json

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, seeded, written

TRUE = {"J_kg_m2": 0.002, "b_N_m_s_rad": 0.004, "spring_N_m_rad": 0.4}
EQUATIONS = """states = ["position_rad", "speed_rad_s"]
inputs = ["torque_N_m"]
[plant.outputs]
position_rad = "position_rad"
[plant.derivatives]
position_rad = "speed_rad_s"
speed_rad_s = "(torque_N_m - b_N_m_s_rad*speed_rad_s - spring_N_m_rad*position_rad) / J_kg_m2"
"""


def plate(folder, scale: float, given: dict[str, float]):
    """Leave a plate on a spring, its angle read `scale` times too large, with values given."""
    random, time = seeded(4), 0.002 * np.arange(2000)
    drive, angle, speed, rows = np.repeat(random.uniform(-0.2, 0.2, 20), 100), 0.0, 0.0, []
    for t, u in zip(time, drive, strict=True):
        rows.append(f"{t:.6g},{u:.6g},{scale * (angle + 1e-3 * random.normal()):.6g}")
        for _ in range(10):
            speed += 2e-4 * (u - TRUE["b_N_m_s_rad"] * speed - TRUE["spring_N_m_rad"] * angle) / TRUE["J_kg_m2"]
            angle += 2e-4 * speed
    folder.mkdir()
    (folder / "log.csv").write_text("\n".join(["time_s,torque_N_m,position_rad", *rows, ""]))
    parameters = "\n".join(f"{name} = {{ value = {value!r}, free = true }}" for name, value in given.items())
    (folder / "project.toml").write_text(
        f'schema = 1\nname = "plate"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "ode"\n{EQUATIONS}'
        f"[plant.parameters]\n{parameters}\n"
    )
    return folder


def warned(folder, capsys) -> list[str]:
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out"), "--json"]) == 0
    return json.loads(capsys.readouterr().out)["plant"]["warnings"]


def test_a_spring_that_ends_a_thousand_times_below_what_is_given_is_said(tmp_path, capsys):
    given = {**TRUE, "spring_N_m_rad": 40.0}
    said = [one for one in warned(plate(tmp_path / "far", 1.0, given), capsys) if "what the project gives" in one]
    assert len(said) == 1 and "spring_N_m_rad = 0.4 N*m/rad, 0.01 times what the project gives" in said[0], said
    assert "J_kg_m2" not in said[0]


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_what_ends_near_its_value_is_not(factor, tmp_path, capsys):
    given = {name: factor * value for name, value in TRUE.items()}
    assert not any("what the project gives" in one for one in warned(plate(tmp_path / "near", 1.0, given), capsys))


def test_an_effect_that_ends_far_from_its_value_is_said_and_the_start_of_a_lag_is_not(tmp_path, capsys):
    random, time = seeded(5), 0.02 * np.arange(2000)
    drive, lag, shown = np.repeat(random.uniform(0.0, 5.0, 20), 100), 0.0, []
    for u in drive:
        shown.append(lag + 30.0 + 0.005 * random.normal())
        lag += (1.0 - np.exp(-0.02 / 0.3)) * (4.0 * u - lag)
    table = {
        "kind": "first_order",
        "input": "valve_V",
        "outputs": ["level_V"],
        "parameters": {"gain": 0.3, "time_constant_s": 0.32, "delay_s": {"value": 0.0, "free": False}},
    }
    effects = '[[plant.effects]]\nname = "sensor_offset"\noutput = "level_V"\noffset_V = { value = 0.2, free = true }'
    folder = written(tmp_path / "run", (table, time, {"valve_V": drive, "level_V": np.array(shown)}), effects=effects)
    said, found = identified(folder, capsys)
    assert found["gain"] == pytest.approx(4.0, rel=0.05)
    far = [one for one in said if "what the project gives" in one]
    assert len(far) == 1 and "offset_V = 30" in far[0] and "gain" not in far[0] and "time_constant" not in far[0], said
