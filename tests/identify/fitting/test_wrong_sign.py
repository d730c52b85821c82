"""A fan that cools, with a start of the wrong sign and a room's temperature that the plant knows nothing of."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.first_order_bench import answered, leave

TRUE = {"gain": -0.65, "time_constant_s": 75.0, "delay_s": 0.0, "output_at_rest": 66.0}
GIVEN = """gain = { value = 1.0, free = true }
time_constant_s = { value = 400.0, free = true }
delay_s = { value = 2.0, free = true }
"""


def fan(folder: Path) -> Path:
    """Leave a recording that begins settled, at 35 % of the fan, and a project that begins at the other sign."""
    random, time = np.random.default_rng(7), np.arange(900.0)
    drive = np.repeat(random.uniform(15.0, 60.0, 9), 100)
    drive[:100] = 35.0
    shown = answered(time, ("fan_percent", drive), TRUE, TRUE["gain"] * 35.0)
    return leave(folder, time, ("fan_percent", drive), shown + 0.05 * random.normal(size=len(time)), GIVEN)


def test_identify_names_the_level_and_finds_the_sign_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = fan(tmp_path)
    assert main(["identify", str(path), "--out", str(tmp_path / "out")]) == 0
    (line,) = (each for each in capsys.readouterr().out.splitlines() if "write output_at_rest" in each)
    level = line.partition("write ")[2].partition(" in [")[0]
    path.write_text(f"{path.read_text()}{level}\n")
    assert main(["identify", str(path), "--out", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["plant"]["parameters"]
    assert found["gain"]["value"] == pytest.approx(TRUE["gain"], rel=0.01)
    assert found["time_constant_s"]["value"] == pytest.approx(TRUE["time_constant_s"], rel=0.01)
    assert found["output_at_rest"]["value"] == pytest.approx(TRUE["output_at_rest"], rel=0.01)


def test_diagnose_names_the_level(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = fan(tmp_path)
    assert main(["diagnose", str(path), "--out", str(tmp_path / "out"), "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    named = {each["name"]: each["parameters"] for each in said["effects"]}
    assert named["sensor_offset"]["offset_C"]["value"] == pytest.approx(TRUE["output_at_rest"], rel=0.01)
    assert said["fit"]["train"]["after"] < 1.1


CYLINDER = """schema = 1
name = "cylinder"
[recordings]
train = ["up.csv", "down.csv"]
[plant]
kind = "ode"
states = ["x"]
inputs = ["valve"]
outputs = { position = "x" }
derivatives = { x = "gain_1_s*valve" }
parameters = { gain_1_s = { value = 2.0, free = true } }
"""


@pytest.mark.parametrize("turned", [False, True])
def test_a_place_runs_against_its_drive_by_how_it_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], turned: bool
) -> None:
    """A valve that rests at -0.3, as one with an offset does: the plant as given runs away from where it stands."""
    time = np.arange(3000) * 0.02
    for name, sign in (("up", 1.0), ("down", -1.0)):
        valve = np.where(time % 20.0 < 2.0, sign, -0.3)
        place = 2.0 + np.cumsum(np.where(valve == -0.3, 0.0, 1.5 * valve)) * 0.02 * (-1.0 if turned else 1.0)
        rows = (f"{t:.2f},{v:.6g},{x:.6g}" for t, v, x in zip(time, valve, place, strict=True))
        (tmp_path / f"{name}.csv").write_text("time_s,valve,position\n" + "\n".join(rows) + "\n")
    (tmp_path / "project.toml").write_text(CYLINDER)
    main(["identify", str(tmp_path / "project.toml"), "--out", str(tmp_path / "out")])
    assert ("runs against valve" in "".join(capsys.readouterr())) == turned


MOTOR = """schema = 1
name = "steps"
[recordings]
train = ["s0.csv", "s1.csv", "s2.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["position_rad"]
[plant.parameters]
R_ohm = { value = 6.7, free = false }
L_H = { value = 5.0e-3, free = false }
ke_V_s_rad = { value = 0.45, free = true }
kt_N_m_A = { value = 0.47, free = false }
J_kg_m2 = { value = 2.0e-3, free = true }
b_N_m_s_rad = { value = 1.0e-3, free = true }
"""


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_reversed_reading_is_told_where_each_recording_is_one_step(
    sign: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An initial current and speed that fit best would turn the motor against each step."""
    time, lag, gain = 0.005 * np.arange(200), 0.06, 2.0
    for k, level in enumerate((1.6, -3.2, 6.4)):
        angle = sign * gain * level * (time - lag * (1.0 - np.exp(-time / lag)))
        angle += 0.005 * np.random.default_rng(k).normal(size=len(time))
        rows = [f"{t:.6g},{level},{y:.6g}" for t, y in zip(time, angle, strict=True)]
        (tmp_path / f"s{k}.csv").write_text("\n".join(["time_s,voltage_V,position_rad", *rows, ""]))
    (tmp_path / "steps.toml").write_text(MOTOR)
    assert main(["identify", str(tmp_path / "steps.toml"), "--out", str(tmp_path / "out"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["plant"]["warnings"]
    against = [each for each in said if "runs against voltage_V" in each]
    assert len(against) == (sign < 0.0), said
    assert not against or against[0].startswith("position_rad of s0.csv, s1.csv, s2.csv runs against voltage_V")
