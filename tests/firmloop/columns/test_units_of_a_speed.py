"""A motor's speed in another unit: what `identify` says to paste is exact, and pasted it gives the motor back."""

from __future__ import annotations

import re

import numpy as np
import pytest

from bench.host.identify_faults import MOTOR, changed, motor, off
from firmloop.cli import main
from tests.firmloop.columns.test_identify_says import identified, seeded, written

PER_UNIT = {"rpm": 30.0 / np.pi, "krpm": 0.03 / np.pi, "deg/s": 180.0 / np.pi, "rev/s": 0.5 / np.pi}
SPEED, BOTH = ["speed_rad_s"], ["speed_rad_s", "current_A"]
FIXED = {  # what is given and right, and the outputs; the rest starts up to 1.6 times off
    "the friction and one constant": (("R_ohm", "L_H", "kt_N_m_A", "b_N_m_s_rad"), SPEED),
    "one constant": (("kt_N_m_A",), BOTH),
    "one constant and the friction, beside the current": (("kt_N_m_A", "b_N_m_s_rad"), BOTH),
    "the back EMF": (("R_ohm", "L_H", "ke_V_s_rad", "b_N_m_s_rad"), SPEED),
    "the inertia": (("J_kg_m2",), BOTH),
}


def bench(folder, factor, fixed, outputs, seed=6):
    random = seeded(seed)
    table, time, columns = changed(motor(random), speed_rad_s=lambda v: factor * v)
    table = {**table, "outputs": outputs, "parameters": off(random, MOTOR, fixed)}
    return written(folder, (table, time, {name: columns[name] for name in ("voltage_V", *outputs)}))


def pasted(folder, line):
    """Put a line into [recordings.rename]."""
    file = folder / "project.toml"
    file.write_text(file.read_text().replace("[plant]", f"[recordings.rename]\n{line}\n[plant]", 1))


@pytest.mark.parametrize("unit", PER_UNIT)
@pytest.mark.parametrize("given", FIXED)
def test_a_unit_of_a_speed_is_named_exactly_and_its_line_gives_the_motor_back(given, unit, tmp_path, capsys):
    fixed, outputs = FIXED[given]
    folder = bench(tmp_path / "log", PER_UNIT[unit], fixed, outputs)
    said, _ = identified(folder, capsys)
    lines = re.findall(r"\[recordings.rename\] (\w+ = \{[^}]*\})", " ".join(said))
    assert lines == [f'speed_rad_s = {{ name = "speed_rad_s", unit = "{unit}" }}'], said
    pasted(folder, lines[0])
    said, found = identified(folder, capsys)
    assert not [one for one in said if "ke / kt" in one or "times what the plant" in one], said
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.02)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("unit", ["rpm", "deg/s"])
def test_a_start_that_is_off_hides_no_unit(unit, seed, tmp_path, capsys):
    said, _ = identified(bench(tmp_path / "log", PER_UNIT[unit], ("kt_N_m_A",), SPEED, seed), capsys)
    assert f'speed_rad_s = {{ name = "speed_rad_s", unit = "{unit}" }}' in said[0]
    assert "scale = " not in said[0]


def test_a_ratio_that_is_exactly_a_unit_asks_for_no_gear(tmp_path, capsys):
    said, _ = identified(bench(tmp_path / "log", PER_UNIT["krpm"], ("kt_N_m_A",), BOTH), capsys)
    assert "the speed looks in thousands of revolutions per minute" in said[0] and "gear" not in said[0]


@pytest.mark.parametrize("outputs", [SPEED, BOTH])
@pytest.mark.parametrize("counts", [400, 2000, 65536])
def test_counts_and_a_gear_are_asked_for_and_no_measured_ratio_is_a_scale(counts, outputs, tmp_path, capsys):
    said, _ = identified(bench(tmp_path / "log", counts / (2.0 * np.pi), ("kt_N_m_A",), outputs), capsys)
    assert "is it in counts of an encoder, about " in said[0] and "with the exact counts a turn" in said[0]
    assert "scale = " not in said[0] and "gear" not in said[0]


def test_a_current_in_another_unit_beside_a_given_inertia_is_no_gear(tmp_path, capsys):
    made = motor(seeded(6))
    table, time, columns = changed(made, current_A=lambda v: 1e3 * v)
    table = {**table, "parameters": off(seeded(6), MOTOR, ("J_kg_m2",))}
    folder = written(tmp_path / "log", (table, time, columns))
    said, _ = identified(folder, capsys)
    line = 'current_A = { name = "current_A", scale = 0.001 }'
    assert line in " ".join(said) and "gear" not in " ".join(said), said
    pasted(folder, line)
    said, found = identified(folder, capsys)
    assert said == [] and found["kt_N_m_A"] == pytest.approx(MOTOR["kt_N_m_A"], rel=0.02)


def test_degrees_a_second_are_not_called_a_unit_per_minute(tmp_path, capsys):
    folder = bench(tmp_path / "log", PER_UNIT["deg/s"], ("R_ohm", "L_H", "kt_N_m_A", "b_N_m_s_rad"), SPEED)
    assert main(["identify", str(folder / "project.toml"), "--out", str(folder / "out")]) == 0
    said = "".join(capsys.readouterr())
    assert "looks in degrees" in said and "looks per minute" not in said


GIVEN = {"R_ohm", "L_H", "kt_N_m_A"}


@pytest.mark.parametrize("friction", [True, False])
@pytest.mark.parametrize(("column", "name"), [("voltage_V", "voltage_V"), ("speed_rad_s", "(it|the speed)")])
@pytest.mark.parametrize("doubt", [0.9, 1.0, 1.12])
def test_a_thousand_times_is_a_unit_before_it_is_a_gear(doubt, column, name, friction, tmp_path, capsys):
    """Though a given constant is in doubt, and whether friction is told beside the back EMF, or given."""
    table, time, columns = changed(motor(seeded(6)), **{column: lambda v: 1e3 * v})
    given = GIVEN if friction else GIVEN | {"b_N_m_s_rad"}
    parameters = {name: {"value": MOTOR[name], "free": name not in given} for name in MOTOR}
    parameters["kt_N_m_A"]["value"] *= doubt
    table = {**table, "outputs": SPEED, "parameters": parameters}
    kept = {name: columns[name] for name in ("voltage_V", *SPEED)}
    said, _ = identified(written(tmp_path / "log", (table, time, kept)), capsys)
    looks = re.search(rf"{name} looks in thousandths of the unit \(mA, mV, mm\): write, ", said[0])
    assert looks and f'{column} = {{ name = "{column}", scale = 0.001 }}' in said[0], said
    assert "gear" not in said[0][: looks.start()] and "counts" not in said[0][: looks.start()]


def test_a_start_that_is_far_off_beside_right_units_is_named_and_no_encoder(tmp_path, capsys):
    table, time, columns = motor(seeded(6))
    parameters = {name: {"value": MOTOR[name], "free": name not in GIVEN} for name in MOTOR}
    parameters = {n: {**p, "value": p["value"] * (5.5 if p["free"] else 1.0)} for n, p in parameters.items()}
    table = {**table, "outputs": SPEED, "parameters": parameters}
    kept = {name: columns[name] for name in ("voltage_V", *SPEED)}
    said, found = identified(written(tmp_path / "log", (table, time, kept)), capsys)
    assert found["ke_V_s_rad"] == pytest.approx(MOTOR["ke_V_s_rad"], rel=0.05)
    assert any("times what the plant as given does: its unit is right, for ke_V_s_rad" in one for one in said), said
    assert not any("counts" in one or "gear" in one for one in said)


@pytest.mark.parametrize("whole", [True, False])
def test_an_angle_that_is_not_in_whole_numbers_is_in_no_counts(whole, tmp_path, capsys):
    random = seeded(8)
    time = 0.005 * np.arange(1200)
    drive, speed, angle = np.repeat(random.uniform(-6.0, 6.0, 24), 50), 0.0, [0.0]
    for u in drive[:-1]:
        angle.append(angle[-1] + 0.005 * speed)
        speed += (1.0 - np.exp(-0.005 / 0.06)) * (2.0 * u - speed)
    read = 400.0 / (2.0 * np.pi) * np.array(angle)
    table = {
        "kind": "rotary_stage",
        "input": "torque_N_m",
        "outputs": ["position_rad"],
        "parameters": {"J_kg_m2": 0.03, "b_N_m_s_rad": 0.5},
    }
    columns = {"torque_N_m": drive, "position_rad": np.round(read) if whole else read}
    said, _ = identified(written(tmp_path / "log", (table, time, columns)), capsys)
    assert any("times what the plant as given does" in one for one in said), said
    assert any("in counts of an encoder" in one for one in said) == whole, said


DRIVES = {  # what the column of the voltage holds, and what is asked for it
    "millivolts": (1e3, 'voltage_V = { name = "voltage_V", scale = 0.001 }'),
    "duty in percent of 12 V": (100.0 / 12.0, "a share of the supply in percent"),
    "counts of 255 at 12 V": (255.0 / 12.0, "the count of a full duty"),
}


@pytest.mark.parametrize("held", DRIVES)
def test_readings_that_are_all_off_by_one_factor_speak_for_the_input(held, tmp_path, capsys):
    """Two notes had each mended the factor of its own: the voltage, and the current by the same thousand again."""
    factor, cure = DRIVES[held]
    random = seeded(6)
    table, time, columns = changed(motor(random), voltage_V=lambda v: factor * v)
    made = {**table, "outputs": BOTH, "parameters": off(random, MOTOR)}
    said, _ = identified(written(tmp_path / "log", (made, time, columns)), capsys)
    told = [one for one in said if "times what the plant as given does" in one]
    assert len(told) == 1 and "which speaks for the input" in told[0] and cure in told[0], said


def test_a_speed_that_no_unit_makes_so_small_may_be_read_behind_a_gear(tmp_path, capsys):
    said, _ = identified(bench(tmp_path / "log", 1.0 / 25.0, ("kt_N_m_A",), SPEED), capsys)
    assert any(re.search(r"behind a gear\? then write gear_ratio = \{ value = \d", one) for one in said), said


def test_a_speed_five_times_too_small_may_be_in_turns_or_read_behind_a_gear(tmp_path, capsys):
    """A gear of 5 and turns, 6.28 times smaller, are nearer than nominal values tell."""
    said, _ = identified(bench(tmp_path / "log", 1.0 / 5.0, (), BOTH, 2), capsys)
    told = [one for one in said if "times what the plant as given does" in one]
    assert len(told) == 1 and "it looks in turns" in told[0], said
    assert re.search(r"or is it read behind a gear\? then write gear_ratio = \{ value = \d", told[0]), told
