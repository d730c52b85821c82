"""A controller of one input beside a plant, and numbers at the ends: it works, or one clear sentence says why not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from firmloop.cli import main

PLANT = """\
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]
[plant.parameters]
gain = { value = 1.0, free = true }
time_constant_s = { value = 1.0, free = true }
delay_s = { value = 0.0, free = false }
"""
REFERENCE = 'reference = { unit = "degC", low = -50, high = 50 }\n'
SIGNALS = """\
measurement = { unit = "degC", low = -50, high = 50 }
output = { unit = "V", low = -12, high = 12 }
"""
SINGLE = {
    "notch": 'kind = "notch"\nfrequency_hz = 10.0',
    "lead_lag": 'kind = "lead_lag"\nzero_rad_s = 1.0\npole_rad_s = 10.0',
    "transfer_function": 'kind = "transfer_function"\nnumerator = [1.0]\ndenominator = [1.0, -0.5]',
    "state_space": 'kind = "state_space"\nA = [[0.5]]\nB = [[1.0]]\nC = [[1.0]]\nD = [[0.0]]',
    "state_feedback": 'kind = "state_feedback"\nQ = [1.0]\nR = [1.0]\nstates = ["measurement"]',
}


def written(folder: Path, controller: str, signals: str, number: str, plant: str = "") -> Path:
    path = folder / "x.toml"
    path.write_text(
        f'schema = 1\nname = "x"\n{plant}[controller]\nperiod_s = 0.01\n{controller}\n[signals]\n{signals}'
        f'[arithmetic]\nnumber = "{number}"\n[target]\nnames = ["host"]\n'
    )
    return path


@pytest.mark.parametrize("kind", SINGLE)
def test_one_input_beside_a_plant(kind: str, tmp_path: Path) -> None:
    path, out = written(tmp_path, SINGLE[kind], SIGNALS, "float32", PLANT), tmp_path / "out"
    assert main(["design", str(path), "--out", str(out)]) == 0
    assert json.loads((out / "design.json").read_text())["margins"] is None
    assert main(["verify", str(path), "--out", str(out), "--steps", "500"]) == 0
    assert json.loads((out / "verdict.json").read_text())["verdict"] == "agrees"


@pytest.mark.parametrize(
    ("controller", "number", "words"),
    [
        ('kind = "pid"\nkp = 1e12', "fixed", "holds no two numbers of this format"),
        ('kind = "pid"\nkp = 1e30', "fixed", "too large for fixed point"),
        ('kind = "pid"\nkp = 1e-30', "fixed", "too small"),
        ('kind = "pid"\nkp = 1e30', "float32", "more than a tenth of its range; lower the gains"),
        ('kind = "pid"\nkp = 1e39', "float32", "kp holds 1e+39; a quantity is 0 or from 1e-30 to 1e+30"),
        ('kind = "pid"\nkp = 1e-46', "float32", "kp holds 1e-46; a quantity"),
        ('kind = "pid"\nkp = 1.0\ntunable = [["kp"]]', "fixed", "cannot have tuned"),
        ('kind = "notch"\nfrequency_hz = 60.0', "fixed", "Nyquist"),
    ],
)
def test_extreme_numbers(
    controller: str, number: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, controller, REFERENCE + SIGNALS, number)
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and "internal" not in said


def test_a_range_below_the_resolution(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    signals = (REFERENCE + SIGNALS).replace("-50, high = 50", "-1e-30, high = 1e-30")
    path = written(tmp_path, 'kind = "pid"\nkp = 1.0', signals, "fixed")
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "signals.reference from -1e-30 to 1e-30 degC holds no two numbers" in capsys.readouterr().err


@pytest.mark.parametrize(
    "line",
    [
        'terminal_resistance = "6.6 ohm"\ntorque_constant = "1e-300 mNm/A"',
        'stall_current = "1.7e308 A"\nstall_torque = "0.1 N*m"',
        'terminal_resistance = "1e40 Mohm"\ntorque_constant = "28 mNm/A"',
    ],
)
def test_a_figure_of_a_datasheet_beyond_any_quantity_is_named(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "p.toml"
    plant = '[plant]\nkind = "dc_motor"\ninput = "voltage_V"\noutputs = ["speed_rad_s"]\n[datasheet]\n'
    path.write_text(f'schema = 1\nname = "motor"\n{plant}nominal_voltage = "24 V"\n{line}\n')
    assert main(["datasheet", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "in SI a quantity is 0 or from 1e-30 to 1e+30" in said and "datasheet." in said
