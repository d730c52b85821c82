"""A parameter of the plant or of an effect that ends far from its given value is said; the start of a lag is not."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bench.host.identify_faults import changed, swing
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


MOTOR = """schema = 1
name = "motor"
[recordings]
train = ["log.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s", "current_A"]
[plant.parameters]
R_ohm = { value = 2.2, free = true }
L_H = { value = 1e-3, free = true }
ke_V_s_rad = { value = 0.028, free = true }
kt_N_m_A = { value = 0.03, free = false }
J_kg_m2 = { value = 2.2e-5, free = true }
b_N_m_s_rad = { value = 1e-5, free = true }
"""
BOTH = {"L_H = { value = 1e-3": "L_H = { value = 0.6", "J_kg_m2 = { value = 2.2e-5": "J_kg_m2 = { value = 1.2e-2"}
KEPT = {"L_H = { value = 0.6, free = true": "L_H = { value = 0.6, free = false"}
LOOSE = {"kt_N_m_A = { value = 0.03, free = false": "kt_N_m_A = { value = 0.028, free = true"}
ROTOR = {"J_kg_m2 = { value = 2.2e-5": "J_kg_m2 = { value = 1.2e-2"}


def turned(folder, capsys, seed: int, changed: dict[str, str]) -> list[str]:
    """What identify says of a motor whose values in the project are changed so."""
    random, time = seeded(seed), 2e-4 * np.arange(3000)
    drive, current, speed = np.repeat(random.uniform(-10.0, 10.0, 50), 60), 0.0, 0.0
    rows = ["time_s,voltage_V,speed_rad_s,current_A"]
    for t, u in zip(time, drive, strict=True):
        read = speed + 0.3 * random.normal(), current + 0.02 * random.normal()
        rows.append(f"{t:.6g},{u:.6g},{read[0]:.6g},{read[1]:.6g}")
        for _ in range(20):
            current += 1e-5 * (u - 2.0 * current - 0.03 * speed) / 1e-3
            speed += 1e-5 * (0.03 * current - 1e-5 * speed) / 2e-5
    (folder / "log.csv").write_text("\n".join([*rows, ""]))
    text = MOTOR
    for one, other in changed.items():
        text = text.replace(one, other)
    (folder / "project.toml").write_text(text)
    return warned(folder, capsys)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (BOTH, "the recordings are met with L_H = 0.00098"),
        (BOTH | KEPT, "asks for L_H = 0.00098"),
        (ROTOR, "the recordings are met with J_kg_m2 = 2e-05 kg*m^2, 0.0017 times what the project gives"),
    ],
    ids=["both", "the winding kept", "the rotor alone"],
)
def test_a_motors_values_hundreds_of_times_off_are_named_and_not_the_clock(changed, told, tmp_path, capsys):
    said = turned(tmp_path, capsys, 6, changed)
    assert any(told in one for one in said), said
    assert not any("thousands of seconds" in one or "encoder" in one for one in said), said


def test_a_rotor_far_off_beside_a_right_voltage_constant_is_no_speed_in_counts(tmp_path, capsys):
    said = turned(tmp_path, capsys, 10, ROTOR | LOOSE)
    assert any("its unit is right, for ke_V_s_rad comes out as 0.03 and is given as 0.028" in one for one in said), said
    assert any("check in [plant.parameters] J_kg_m2 and its unit, which is given as 0.012" in one for one in said)
    assert not any("encoder" in one or "thousands of seconds" in one for one in said), said


def test_a_drive_in_thousandths_is_not_mended_by_thousands_of_what_it_moves(tmp_path, capsys):
    made = changed(swing(seeded(3)), valve_V=lambda v: 1e3 * v)
    (says,), _ = identified(written(tmp_path / "log", made), capsys)
    first, _, second = says.partition("; or ")
    assert "valve_V looks in thousandths" in first and 'valve_V = { name = "valve_V", scale = 0.001 }' in first
    assert "level looks in thousands of the unit" in second
