"""Findings about a circuit and a tank are said without shaft, brushes, friction and torque, in units of that plant."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

CIRCUIT = """schema = 1
name = "converter"
[recordings]
train = ["a.csv"]
[plant]
kind = "ode"
states = ["i_A"]
inputs = ["duty"]
[plant.outputs]
current_A = "i_A"
[plant.derivatives]
i_A = "(duty*24 - load_ohm*i_A) / coil_H"
[plant.balances]
i_A = { kind = "voltage", per = "1/coil_H" }
[plant.parameters]
load_ohm = { value = 4.5, free = true }
coil_H = { value = 8e-4, free = true }
"""
TANK = """schema = 1
name = "tank"
[recordings]
train = ["a.csv"]
[plant]
kind = "ode"
states = ["level_m"]
inputs = ["pump_V"]
[plant.outputs]
height_m = "level_m"
[plant.derivatives]
level_m = "(pump*pump_V - out*sqrt(2*9.81*level_m)) / area_m2"
[plant.balances]
level_m = { kind = "flow", per = "1/area_m2" }
[plant.parameters]
pump = { value = 1.8e-5, free = true }
out = { value = 7e-5, free = true }
area_m2 = { value = 0.02, free = false }
"""
NO_WORDS = ("shaft", "brush", "torque", "friction", "motor", "locked")


def written(folder: Path, project: str, header: str, rows: list[str]) -> Path:
    (folder / "a.csv").write_text("\n".join([header, *rows, ""]))
    (folder / "p.toml").write_text(project)
    return folder / "p.toml"


def circuit(folder: Path) -> Path:
    """A coil of 1 mH and 5 ohm behind a half bridge and two diodes in series that drop 1.4 V, switched at 1 kHz."""
    random, current, rows = np.random.default_rng(3), 0.0, []
    duties = np.repeat(random.uniform(-0.8, 0.8, 40), 20)
    for k, duty in enumerate(duties):
        rows.append(f"{k * 1e-4:.4f},{duty:.6g},{current + random.normal(0.0, 0.01):.6g}")
        for _ in range(50):
            current += 1e-4 / 50 / 1e-3 * (duty * 24.0 - 5.0 * current - 1.4 * np.tanh(current / 0.02))
    return written(folder, CIRCUIT, "time_s,duty,current_A", rows)


def tank(folder: Path) -> Path:
    """A tank of 0.02 m^2 from which 1.2e-5 m^3/s leak beside its outlet."""
    random, level, rows = np.random.default_rng(4), 0.1, []
    for k, volt in enumerate(np.repeat(random.uniform(6.0, 11.0, 12), 60)):
        rows.append(f"{k * 2.0:.1f},{volt:.6g},{level + random.normal(0.0, 3e-4):.6g}")
        for _ in range(20):
            level += 0.1 / 0.02 * (2e-5 * volt - 6e-5 * np.sqrt(2.0 * 9.81 * level) - 1.2e-5)
    return written(folder, TANK, "time_s,pump_V,height_m", rows)


def test_a_drop_in_a_circuit_is_one_of_a_diode_and_not_of_brushes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diagnose", str(circuit(tmp_path)), "--out", str(tmp_path / "o")]) == 1
    finding = json.loads((tmp_path / "o" / "diagnosis.json").read_text())
    assert [each["name"] for each in finding["effects"]] == ["brush_drop"]
    low, high = finding["effects"][0]["parameters"]["voltage_V"]["ci95"]
    assert low < 1.4 < high
    assert "a diode or the driver drops a constant voltage in the direction of the current" in capsys.readouterr().out
    told = [each["says"] for each in finding["effects"]] + [each["tell_apart_by"] for each in finding["alternatives"]]
    assert not [(word, each) for each in told for word in NO_WORDS if word in each]


def test_a_leak_is_told_without_friction_and_in_cubic_metres_a_second(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = tank(tmp_path)
    assert main(["identify", str(project), "--out", str(tmp_path / "i")]) == 0
    said = capsys.readouterr().out
    assert "an offset of the sensor, or something constant that the equations lack" in said
    assert not [word for word in NO_WORDS if word in said]
    assert main(["diagnose", str(project), "--out", str(tmp_path / "o")]) == 1
    disturbance = json.loads((tmp_path / "o" / "diagnosis.json").read_text())["disturbance"]
    assert disturbance["flow"]["unit"] == "m^3/s"
